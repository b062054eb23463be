"""Pictures of what is known before anything is fitted: sensitivities, what a table determines, what a plan shows."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from pkmcal_cli.base.rotation import Array
from pkmcal_cli.calibration.fitted_frames import frame_parameters
from pkmcal_cli.calibration.mean_sensitivity import NO_SHIFT, Sensitivity, ranked
from pkmcal_cli.calibration.observability_indices import Observability
from pkmcal_cli.diagnosis.experiment_design import Plan
from pkmcal_cli.model.model import Model
from pkmcal_cli.pictures.dot_list import Dot, Scale, dot_part
from pkmcal_cli.pictures.parts import Part, composed, shown_unit
from pkmcal_cli.pictures.picture import Picture
from pkmcal_cli.pictures.scatter import Cloud, moving, scatter_part
from pkmcal_cli.pictures.titles import Titles
from pkmcal_cli.report.analysis_report import held_by_range
from pkmcal_cli.report.number_format import NEVER, handy, three_digits
from pkmcal_cli.report.parameters import parameter_unit
from pkmcal_cli.units.file_units import FileUnits

_STATUS = ("detectable", "weak", "invisible")


def sensitivity_picture(
    result: Sensitivity, model: Model, titles: Titles, coordinate: str | None = None
) -> Picture:
    """Mean shift and rotation of the tool point by each parameter, largest first; along one coordinate, with signs."""
    if coordinate is not None:
        parts = [_along_part(result, model, coordinate)]
    else:
        moves, turns = (any(ranked(getattr(p, k)) for p in result.parameters) for k in ("position", "orientation"))
        parts = [] if turns and not moves else [
            _sizes_part(result, model, "position", "length", "mean shift of the tool point")
        ]  # fmt: skip
        if turns:
            parts.append(_sizes_part(result, model, "orientation", "angle", "mean rotation of the tool point"))
    first = ", ".join(p.name for p in result.parameters[:5])
    alt = f"Sensitivity of the tool point to {len(result.parameters)} parameters; most influential: {first}."
    return composed("sensitivity", titles, alt, parts)


def _sizes_part(result: Sensitivity, model: Model, kind: str, dimension: str, quantity: str) -> Part:
    shifts = {p.name: float(getattr(p, kind)) for p in result.parameters}
    unit = shown_unit(dimension, max((ranked(s) for s in shifts.values()), default=0.0))
    dots = []
    for p in sorted(result.parameters, key=lambda p: -ranked(shifts[p.name])):
        seen = ranked(shifts[p.name]) > 0
        file_unit = parameter_unit(model, p.name)
        dots.append(Dot(name=p.name, value=shifts[p.name] / unit.scale if seen else math.nan,
                        text=f"by {handy(p.size, file_unit)}" if seen else "no influence"))  # fmt: skip
    known = [d.value for d in dots if math.isfinite(d.value)]
    wide = bool(known) and max(known) > 30 * min(known)
    note = " (logarithmic)" if wide else ""
    return dot_part(dots, Scale(label=f"{quantity} [{unit.text}]{note}", logarithmic=wide, line=None if wide else 0.0))


def _along_part(result: Sensitivity, model: Model, coordinate: str) -> Part:
    mean, most = result.along(coordinate)
    dimension = "angle" if coordinate.startswith("r") else "length"
    unit = shown_unit(dimension, float(np.abs(most).max(initial=0.0)))
    sizes = {p.name: p.size for p in result.parameters}
    order = np.argsort(-np.abs(mean), kind="stable")
    dots = [
        Dot(name=result.names[k], value=float(mean[k]) / unit.scale if abs(mean[k]) > NO_SHIFT else 0.0,
            text=f"by {handy(sizes[result.names[k]], parameter_unit(model, result.names[k]))}")
        for k in order
    ]  # fmt: skip
    return dot_part(dots, Scale(label=f"mean shift of {coordinate} [{unit.text}]", line=0.0))


def observability_picture(result: Observability, model: Model, titles: Titles) -> Picture:
    """Expected standard uncertainty of each parameter as a share of its range, and the singular values."""
    dots, frames = [], frame_parameters(model)  # whose ranges nobody stated: as shares of them they are nothing
    gone_by_name = result.directions.undetermined()
    for name, std, alone, gone in zip(result.selected, result.std, result.alone, gone_by_name, strict=True):
        if name in frames:
            continue
        p, unit = model.parameters[model.names.index(name)], parameter_unit(model, name)
        known = not gone and p.range > 0
        good = bool(std < p.range / 2) and not held_by_range(float(std), float(alone))
        dots.append(Dot(name=name, value=float(std / p.range) if known else math.nan, good=good,
                        text=f"u = {handy(float(std), unit)}" if not gone else "undetermined"))  # fmt: skip
    label = "expected standard uncertainty / range (dashed: no better than it; open: weak, held by it; logarithmic)"
    parts = [dot_part(dots, Scale(label=label, logarithmic=True, line=0.5))]
    values = [float(s) for s in result.directions.singular_values]
    if values:
        least = max(values) * 1e-12
        spectrum = [Dot(name=str(k + 1), value=s if s > least else math.nan, text=three_digits(s) if s > least else "0")
                    for k, s in enumerate(values)]  # fmt: skip
        parts.append(dot_part(spectrum, Scale(label="singular values, whitened (logarithmic)", logarithmic=True)))
    lost = sum(result.directions.undetermined())
    alt = f"Expected uncertainties of {len(dots)} parameters as shares of their ranges; {lost} undetermined."
    return composed("observability", titles, alt, parts)


@dataclass(frozen=True)
class PlannedPositions:
    """Poses (N, K), m and rad, of planned points and of those that are added, in coordinates of the tool point."""

    planned: Array
    added: Array
    names: tuple[str, ...]


def plan_picture(plan: Plan | None, titles: Titles, units: FileUnits, places: PlannedPositions | None) -> Picture:
    """Where the points are; what they detect, by the smallest size as a share of what is plausible."""
    parts, sentences = [], []
    columns = [] if places is None else moving(places.names, np.vstack([places.planned, places.added]))
    if places is not None and len(places.planned) + len(places.added) and len(columns) > 1:
        names, unit = [places.names[k] for k in columns], units.angle if columns[0] else units.length
        clouds = [Cloud("planned", places.planned[:, columns]), Cloud("added", places.added[:, columns])]
        parts.append(scatter_part([c for c in clouds if len(c.at)], names, unit))
        sentences.append(f"{len(places.planned)} points planned, {len(places.added)} added")
    if plan is not None and plan.visibilities:
        parts.append(_detected_part(plan))
        counts = {s: sum(v.status == s for v in plan.visibilities) for s in _STATUS}
        sentences.append(", ".join(f"{n} effects {s}" for s, n in counts.items()))
    return composed("plan", titles, f"{'; '.join(sentences) or 'Nothing is planned'}.", parts)


def _detected_part(plan: Plan) -> Part:
    """Sizes from which effects are detected."""
    model, dots = plan.problem.model, []
    for v in sorted(plan.visibilities, key=lambda v: (_STATUS.index(v.status), _share(v.detected, v.plausible))):
        unit, share = parameter_unit(model, v.parameter), _share(v.detected, v.plausible)
        seen = math.isfinite(share) and share < NEVER
        dots.append(Dot(name=v.hypothesis.name, value=share if seen else math.nan, good=v.status == "detectable",
                        text=f"from {handy(v.detected, unit)}" if seen else "never"))  # fmt: skip
    label = "size detected in 80 % of campaigns / plausible size (dashed: equal; open: weak; logarithmic)"
    return dot_part(dots, Scale(label=label, logarithmic=True, line=1.0))


def _share(size: float, plausible: float) -> float:
    return size / plausible if plausible > 0 else math.nan
