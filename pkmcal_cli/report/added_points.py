"""Points that a plan adds, for what, and what they bring: figures, sentences, tables."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

from pkmcal_cli.base.plural import count
from pkmcal_cli.calibration.problem import Problem
from pkmcal_cli.correction.whole_steps import counts_steps
from pkmcal_cli.diagnosis.experiment_design import Aim, Chosen
from pkmcal_cli.diagnosis.score import minimal_detectable
from pkmcal_cli.model.model import Model
from pkmcal_cli.report.console import Reporter
from pkmcal_cli.report.number_format import detectable_size, finite, plausible_share, readable, to_digits
from pkmcal_cli.report.parameters import parameter_unit
from pkmcal_cli.units.unit_text import parse_unit

_MOST = 400  # points that a plan adds
_WORTH = 0.3  # of an uncertainty: from there on it is worth saying what is added to it
_ENOUGH = 2.0  # standard deviations of the prior: the plausible size
OTHER_MEASUREMENTS = "other measurements: a further instrument or coordinate, or the length itself on the bench"
"""What tells of a parameter where poses do not."""


@dataclass(frozen=True)
class Reached:
    """A parameter's standard uncertainty, SI, by the plan, and with the fewest points that reach a limit, if any do.

    held: what parameters that are not identified add to it, where that is not in it.
    """

    name: str
    limit: float
    before: float
    after: float
    held: float = 0.0

    @property
    def done(self) -> bool:
        """Whether the limit is kept."""
        return self.after <= self.limit

    def within_reach(self, points: int) -> bool:
        """Whether more points could keep the limit, if every one told as much as these: the best are chosen first."""
        return points * self._information(self.limit) <= _MOST * self._information(self.after)

    def remedy(self, points: int) -> str:
        """What to do where these points do not keep the limit."""
        if self.within_reach(points):
            return "use more points (--points), or other measurements"
        return f"more points hardly help, only {OTHER_MEASUREMENTS}"

    def _information(self, std: float) -> float:
        """What is known with a standard uncertainty beyond what the plan tells, 1/SI^2."""
        return 1.0 / std**2 - 1.0 / self.before**2


@dataclass(frozen=True)
class Added:
    """Points chosen for an aim, as a problem; reached: where the aim is a standard uncertainty."""

    aim: Aim
    points: Problem
    chosen: Chosen
    reached: Reached | None = None

    @property
    def figures(self) -> tuple[float, float]:
        """Before and after: standard uncertainty, SI; log determinant; minimal detectable size in prior deviations."""
        if self.reached is not None:
            return self.reached.before, self.reached.after
        pair = (self.chosen.before, self.chosen.after)
        return pair if self.aim.kind == "determine" else (minimal_detectable(pair[0]), minimal_detectable(pair[1]))

    @property
    def short(self) -> bool:
        """Whether plausible sizes still cannot be seen or separated."""
        return self.aim.kind != "determine" and not self.figures[1] < _ENOUGH

    def json(self, model: Model) -> dict[str, Any]:
        """The aim and its figure."""
        before, after = self.figures
        unit, scale = None, 1.0
        if self.reached is not None:
            file_unit = parameter_unit(model, self.reached.name)
            unit, scale = file_unit.text, file_unit.scale
        figure = "std" if self.reached is not None else "log_determinant" if self.aim.kind == "determine" else "mdb"
        return {
            "kind": self.aim.kind,
            "figure": figure,
            "before": finite(before / scale),
            "after": finite(after / scale),
            "unit": unit,
            "reached": None if self.reached is None else self.reached.done,
            "held_adds": None if self.reached is None else finite(self.reached.held / scale),
        }

    def cells(self, model: Model) -> list[dict[str, Any]]:
        """Set values and sides of every point."""
        out = []
        for k, readings in enumerate(self.points.rows.readings):
            cells: dict[str, Any] = {}
            for a, actuator in enumerate(model.actuators):
                unit = parse_unit(actuator.unit)
                value = unit.from_si(float(readings[a]))
                cells[actuator.name] = finite(round(value) if counts_steps(unit) else value)
                cells[f"dir.{actuator.name}"] = finite(float(self.points.rows.columns[f"dir.{actuator.name}"][k]))
            out.append(cells)
        return out

    def show(self, to: Reporter, model: Model) -> None:
        """What the points bring, and where they are."""
        to.say()
        to.say(self._summary(model))
        if self.reached is not None and self.reached.held > _WORTH * self.reached.after:
            to.say(self._beside_held(model, self.reached))
        if len(self.points):
            self.show_points(to, model)

    def show_points(self, to: Reporter, model: Model) -> None:
        """Set values and sides of the points."""
        names = model.drive_names
        headers = tuple(f"{a.name} [{parse_unit(a.unit).text}]" for a in model.actuators)
        sides = {1.0: "+", -1.0: "-"}
        rows = [
            tuple(f"{_shown(float(p[n]))} {sides.get(p[f'dir.{n}'] or 0.0, '')}".rstrip() for n in names)
            for p in self.cells(model)
        ]
        to.table("Points to add (set values; + approach from below, - from above)", headers, rows, left=0)

    def _summary(self, model: Model) -> str:
        points = count(len(self.points), "further point")
        if self.reached is not None:
            unit = parameter_unit(model, self.reached.name)
            before, after = (readable(x, unit) if math.isfinite(x) else "undetermined" for x in self.figures)
            limit = readable(self.reached.limit, unit)
            if self.reached.done and not len(self.points):
                return f"no further point: standard uncertainty of {self.reached.name} {before}, wanted {limit}"
            words = f"{points}: standard uncertainty of {self.reached.name} {before} -> {after}, wanted {limit}"
            return words if self.reached.done else f"{words}: NOT REACHED; {self.reached.remedy(len(self.points))}"
        words = {
            "see": "smallest detectable size",
            "separate": "smallest separable size",
            "determine": "log determinant of the information matrix",
        }[self.aim.kind]
        before, after = (self._figure_text(model, x) for x in self.figures)
        return f"{points}: {words} {before} -> {after}"

    def _beside_held(self, model: Model, reached: Reached) -> str:
        """What a calibration will add to the uncertainty, and what to do about it."""
        added = readable(reached.held, parameter_unit(model, reached.name))
        return (
            f"note: parameters that are not identified add {added} (`held adds` of `calibrate`), which no points take "
            "away; identify them too (`--select`), or measure them and state smaller ranges"
        )

    def _figure_text(self, model: Model, value: float) -> str:
        """An aim's figure: a size in its unit, or as a share of the plausible ones where effects differ."""
        if self.aim.kind == "determine":
            return to_digits(value, 4)
        declared = [model.parameters[model.names.index(n)] for g in self.aim.parameters for n in g]
        alike = {(p.range, p.unit) for p in declared}
        if len(alike) == 1 and len(declared) == len(self.aim.parameters):
            plausible = declared[0].range
            return detectable_size(0.5 * value * plausible, plausible, parse_unit(declared[0].unit or "1"))
        return plausible_share(value / _ENOUGH)


def _shown(value: float) -> str:
    """Six digits, of whole numbers all."""
    return f"{value:.0f}" if value == round(value) else f"{value:.6g}"
