"""Numbers behind the pictures of a diagnosis: residuals over what drives them, angles between effects, shares."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from pkmcal_cli.base.rotation import Array
from pkmcal_cli.calibration.fit import Fit
from pkmcal_cli.calibration.problem import Problem
from pkmcal_cli.diagnosis.confirm import cells
from pkmcal_cli.diagnosis.experiment_design import cosines_between
from pkmcal_cli.diagnosis.findings import Finding
from pkmcal_cli.diagnosis.groups import pose_shapes
from pkmcal_cli.diagnosis.hypotheses import Hypothesis
from pkmcal_cli.diagnosis.refits import refit
from pkmcal_cli.diagnosis.run_diagnosis import Diagnosis
from pkmcal_cli.diagnosis.scoring import linear_without, score_without
from pkmcal_cli.diagnosis.unit_columns import unit_columns
from pkmcal_cli.model.effect_sites import PlacedEffect
from pkmcal_cli.prediction.inputs import SiteInputs
from pkmcal_cli.units.measurands import Measurand
from pkmcal_cli.units.unit_text import Unit, parse_unit

_MOST_ALIKE = 12
_CLEAR = 0.1  # of the largest rise of temperature: rows with less say nothing per kelvin
_EVEN = 1e-3  # of its size: a constant
_JUMPS = 0.15  # of its size that a curve goes from one row to the next, on average; what jumps more is none


@dataclass(frozen=True, kw_only=True)
class DriverPanel:
    """One accepted effect over what drives it: measured displacement of its entry (N,), SI, with its standard
    uncertainty, what the effect says and 1.96 of its standard uncertainties; `side` (N,) of approach, or None.

    `x` (N,) in SI and `shown_x` in `unit`; `rotary`: whether the entry turns (rad) instead of moving (m). Where
    temperature acts along a travel, displacements are per kelvin, over the travel: their slope is the expansion.
    """

    finding: Finding
    name: str
    unit: str
    x: Array
    measured: Array
    noise: Array
    fitted: Array
    band: Array
    side: Array | None
    rotary: bool
    per_kelvin: bool = False

    @property
    def displaced_in(self) -> Unit:
        """Unit of the displacements where they are shown."""
        return parse_unit(("urad" if self.rotary else "um") + ("/K" if self.per_kelvin else ""))

    @property
    def quantity(self) -> str:
        """What is shown over what drives it."""
        return "displacement per kelvin" if self.per_kelvin else "displacement"

    @property
    def title(self) -> str:
        """The effect, and of several places the one that is shown."""
        hypothesis = self.finding.hypothesis
        placed = len(hypothesis.placed)
        return hypothesis.name + (f", here at {_largest(self.finding).at}, of {placed} places" if placed > 1 else "")

    @property
    def curve(self) -> bool:
        """Whether what is fitted is a function of x alone: no line runs through rows of different poses."""
        sides = np.zeros(len(self.x)) if self.side is None else np.sign(self.side)
        return all(_is_function(self.x[sides == s], self.fitted[sides == s]) for s in np.unique(sides))

    @property
    def unit_name(self) -> str:
        """What `unit` is called."""
        return parse_unit(self.unit).text

    @property
    def shown_x(self) -> Array:
        """Values of what drives it, in its unit."""
        unit = parse_unit(self.unit)
        return np.asarray((self.x - unit.offset) / unit.scale)


def driver_panel(diagnosis: Diagnosis, finding: Finding) -> DriverPanel | None:
    """An effect's picture, of several places that where it is largest; None for parameters and for effects that move
    nothing by themselves."""
    largest = _largest(finding)
    placed = next((e for e in diagnosis.problem.model.effects if e.name == largest.name), None)
    if placed is None or placed.effect.enters in ("stiffness", "weight", "drive_force", "load"):
        return None
    search, problem, shape = diagnosis.search, diagnosis.problem, diagnosis.problem.readings.shape
    linear = linear_without(search, [finding.hypothesis], [finding.hypothesis])
    every = finding.hypothesis.parameters
    here = [every.index(n) for n in largest.parameters]
    by_size_of_all = linear.of(every) / linear.scale_of(every)
    columns, estimate = by_size_of_all[:, here], np.array(finding.estimate)[here]
    elsewhere = by_size_of_all @ np.array(finding.estimate) - columns @ estimate
    index = [search.fit.selected.index(n) for n in largest.parameters]
    unit = _leading(problem, diagnosis, placed, (columns @ estimate).reshape(shape))
    length2 = (unit**2).sum(axis=1)
    used = (length2 > 1e-6 * length2.max()) & problem.measured.any(axis=1)

    def displaced(x: Array) -> Array:
        """Of whitened readings (n,) or (n, k), the displacement of the entry (N,) or (N, k) that they show."""
        rows = x.reshape(*shape, -1)[used]
        return np.asarray(np.einsum("nc,nck->nk", unit[used], rows) / length2[used, None]).reshape(len(rows), -1)

    by_size = displaced(columns)
    covariance = np.nan_to_num(search.fit.covariance[np.ix_(index, index)])
    name, unit_text, x, side = _driver(problem, placed)
    panel = DriverPanel(
        finding=finding,
        name=name,
        unit=unit_text,
        x=x[used],
        measured=displaced(linear.residual - elsewhere)[:, 0],
        noise=1 / np.sqrt(length2[used]),
        fitted=by_size @ estimate,
        band=1.96 * np.sqrt(np.einsum("nk,kl,nl->n", by_size, covariance, by_size)),
        side=None if side is None else side[used],
        rotary=placed.effect.enters == "carriage" or placed.sites[0].kind == "rotary",
    )
    return _by_temperature(panel, problem, placed, search.fit.values, used)


def _by_temperature(
    panel: DriverPanel, problem: Problem, placed: PlacedEffect, values: Array, used: NDArray[np.bool_]
) -> DriverPanel:
    """A panel of an effect of temperature: behind its lag; what acts along a travel per kelvin, over the travel."""
    if "temperature" not in placed.effect.needs or "time" in placed.effect.needs or placed.effect.enters == "frame":
        return panel
    site, numbers = placed.sites[0], problem.model.by_name(values)
    lag = sum(numbers[n] for n in placed.parameters if n.endswith(".lag"))
    rise = SiteInputs(site, problem.model, problem.rows, placed, None).lagged(lag)[used]
    if placed.effect.enters != "command":
        if lag:
            first = panel.x - SiteInputs(site, problem.model, problem.rows, placed, None).temperature_rise[used]
            panel = replace(panel, name=f"{panel.name} behind its lag", x=first + rise)
        return panel
    clear = np.abs(rise) > _CLEAR * np.abs(rise).max()
    drive, by = problem.model.actuators[site.actuator], rise[clear]
    return replace(
        panel, name=drive.name, unit=drive.unit, x=problem.rows.readings[used, site.actuator][clear], per_kelvin=True,
        measured=panel.measured[clear] / by, noise=panel.noise[clear] / np.abs(by), fitted=panel.fitted[clear] / by,
        band=panel.band[clear] / np.abs(by),
    )  # fmt: skip


def _is_function(x: Array, y: Array) -> bool:
    """Whether y (N,) goes up and down over x as a curve does, not from row to row."""
    order = np.argsort(x, kind="stable")
    travelled, size = float(np.abs(np.diff(y[order])).sum()), float(np.ptp(y))
    return size <= _EVEN * float(np.abs(y).max()) or travelled <= max(_JUMPS * len(y), 3.0) * size


def _largest(finding: Finding) -> Hypothesis:
    """The member of an effect that stands out most."""
    size = np.abs(np.array(finding.estimate)) / np.array(finding.std)
    clear = dict(zip(finding.hypothesis.parameters, np.nan_to_num(size), strict=True))
    return max(finding.hypothesis.placed, key=lambda h: max(clear[n] for n in h.parameters))


def _leading(problem: Problem, diagnosis: Diagnosis, placed: PlacedEffect, change: Array) -> Array:
    """Unit column (N, C) of that number of the entry which explains most of the effect's change (N, C)."""
    by_part: dict[int, Array] = {}
    for unit in unit_columns(problem, diagnosis.search.fit.values, diagnosis.search.fit.after.start, [placed]):
        by_part[unit.part] = by_part.get(unit.part, 0.0) + unit.column
    return max(by_part.values(), key=lambda u: float(((u * change).sum(axis=1) ** 2 / (u**2).sum()).sum()))


def _driver(problem: Problem, placed: PlacedEffect) -> tuple[str, str, Array, Array | None]:
    """Name, unit and values (N,) of what an effect depends on, and the side of approach where it counts."""
    columns, needs = problem.rows.columns, placed.effect.needs
    site = placed.sites[0]
    if "temperature" in needs and placed.effect.enters != "frame":
        name = f"T.{site.part}" if f"T.{site.part}" in columns else "T"
        return name, "degC", columns[name], None
    if "time" in needs:
        return "time", "min", columns["time"], None
    if site.actuator >= 0:
        drive = problem.model.actuators[site.actuator]
        side = columns[f"dir.{drive.name}"] if "direction" in needs else None
        return drive.name, drive.unit, problem.rows.readings[:, site.actuator], side
    return "row", "1", np.arange(1.0, len(problem) + 1), None


@dataclass(frozen=True)
class Likeness:
    """An effect found, the other one that is most similar to it, the cosine of the angle between them, and whether
    these data tell the two apart."""

    name: str
    rival: str
    cosine: float
    distinct: bool


def nearest_rivals(diagnosis: Diagnosis) -> list[Likeness]:
    """Of each accepted effect the one most similar to it; the same effect at more or fewer places is no other."""
    search = diagnosis.search
    scored = score_without(search, search.accepted, search.candidates.hypotheses)
    names = [h.name for h in scored.hypotheses]
    accepted = [names.index(h.name) for h in search.accepted]
    order = [k for k in np.argsort(-scored.log_bayes) if scored.scores[k].count and k not in accepted]
    chosen = [*accepted, *(int(k) for k in order)][:_MOST_ALIKE]
    hypotheses = [scored.hypotheses[k] for k in chosen]
    cosines = cosines_between(scored.linear, hypotheses, [scored.scores[k] for k in chosen])
    sets = {f.hypothesis.name: {r.hypothesis.name for r in f.rivals} for f in diagnosis.findings}
    out = []
    for k in range(len(accepted)):
        others = [j for j, h in enumerate(hypotheses) if j != k and not _nested(h, hypotheses[k])]
        if others:
            nearest = max(others, key=lambda j: float(cosines[k, j]))
            name, rival = hypotheses[k].name, hypotheses[nearest].name
            out.append(Likeness(name, rival, float(cosines[k, nearest]), rival not in sets.get(name, ())))
    return out


def _nested(one: Hypothesis, other: Hypothesis) -> bool:
    return one.nested(other) or one.akin(other)


@dataclass(frozen=True)
class FieldMap:
    """A smooth field of the pose fitted to what is left of the positions: `vectors` (N, 3) at places `at` (N, 3), SI,
    and the share of the variance that it explains on cells of the workspace that were left out."""

    at: Array
    vectors: Array
    explained: float

    @property
    def largest(self) -> int:
        """Row where the field is largest."""
        return int(np.argmax((self.vectors**2).sum(axis=1)))


def field_map(diagnosis: Diagnosis) -> FieldMap | None:
    """The map of what is unknown; None where positions are not measured in all channels, or rows are few."""
    problem = diagnosis.problem
    positions = problem.model.measuring(Measurand.POSITION)[:3]
    channels = np.array(positions, dtype=np.intp)
    rows = np.nonzero(problem.measured[:, channels].all(axis=1))[0]
    if not len(channels) or not len(rows):
        return None
    part, left = problem.take(rows), _without_replaced(diagnosis).after.residual[np.ix_(rows, channels)]
    tried = [_smooth(part, left, degree) for degree in range(1, 6)]
    best = max((t for t in tried if t is not None), key=lambda t: t[1], default=None)
    return None if best is None else FieldMap(problem.readings[np.ix_(rows, channels)], *best)


def _without_replaced(diagnosis: Diagnosis) -> Fit:
    """The fit without the effects that something nameless explains better."""
    gone = {name for u in diagnosis.unknown for name in u.replaces}
    if not gone:
        return diagnosis.search.fit
    kept = tuple(h for h in diagnosis.search.accepted if h.name not in gone)
    return refit(replace(diagnosis.search, accepted=kept), {}) or diagnosis.search.fit


def _smooth(problem: Problem, left: Array, degree: int) -> tuple[Array, float] | None:
    """A field of this degree fitted to positions (N, C), and its share of the variance on cells left out."""
    shapes = pose_shapes(problem, degree)
    if not shapes.shape[1]:
        return None
    labels, unseen = cells(problem), np.zeros_like(left)
    for fold in np.unique(labels):
        out = labels == fold
        unseen[out] = shapes[out] @ np.linalg.lstsq(shapes[~out], left[~out], rcond=None)[0]
    explained = 1 - float(((left - unseen) ** 2).sum() / (left**2).sum())
    return shapes @ np.linalg.lstsq(shapes, left, rcond=None)[0], explained
