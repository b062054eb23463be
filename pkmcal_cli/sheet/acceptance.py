"""Figures of acceptance standards, by their names only where what they ask for was measured."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

from pkmcal_cli.calibration.positioning_accuracy import (
    FEWEST_APPROACHES,
    FEWEST_TARGETS,
    CircleDeviation,
    circle_deviation,
)
from pkmcal_cli.calibration.predicted_lines import PredictedLine, predicted_lines
from pkmcal_cli.calibration.repeated_targets import (
    AxisRun,
    PoseRun,
    axis_runs,
    circular,
    measured_targets,
    pose_runs,
)
from pkmcal_cli.calibration.residual import evaluate
from pkmcal_cli.loading.covariates import at_rest, resting, with_sides
from pkmcal_cli.sheet.content import Block, Section, Table, Text, section
from pkmcal_cli.sheet.results import Results

_MM_PER_MIN = 60e3  # of 1 m/s
_AXIS = ("A", "R", "E", "M", "B")
_LINE = ("E", "M", "B")
_ALONG = (
    "E: range of the deviations along the axis from either side, M: range of the means of both sides, B: largest "
    "difference between the sides (ISO 230-2). They are of this line alone, so they are less than the largest distance "
    "between measured and nominal points in the whole workspace (above: errors as built)."
)
_COMMANDED_BY = {"as built": "the nominal parameters", "after correction": "the identified parameters"}


@dataclass(frozen=True, kw_only=True)
class Acceptance:
    """What repeats and circles of a table say, and, without repeats, what the identified model predicts.

    state: of the machine whose repeats and circles these are, "as built" or "after correction"; lines are those of the
    machine as built; note: under which conditions they are predicted.
    """

    results: Results
    state: str
    axes: Sequence[AxisRun]
    poses: Sequence[PoseRun]
    circle: tuple[float, CircleDeviation] | None  # with the radius commanded, m
    lines: Sequence[PredictedLine]
    note: str

    def section(self) -> Section | None:
        """For the page."""
        blocks: list[Block | None] = [self._axes(), self._poses(), self._circle()]
        measured = any(block is not None for block in blocks)
        if not self.axes:
            text = f"No ISO 230-2 figures: they need {FEWEST_APPROACHES} approaches from each side to each of at least "
            text += f"{FEWEST_TARGETS} targets in a line along one coordinate."
            blocks += [Text(text, "note"), self._lines()]
            if self.lines:
                blocks.append(Text(_ALONG, "note"))
            if self.lines and self.note:
                blocks.append(Text(self.note[0].upper() + self.note[1:] + ".", "note"))
        basis = f"Measured {self.state}: deviations from the poses that {_COMMANDED_BY[self.state]} give for the set "
        basis += "values in the table."
        return section("acceptance", "Acceptance figures", [Text(basis) if measured else None, *blocks])

    def _at(self, coordinates: Sequence[tuple[str, float]]) -> str:
        return ", ".join(f"{name} = {self.results.place_text(value)}" for name, value in coordinates)

    def _axes(self) -> Table | None:
        rows = []
        for run in self.axes:
            f = run.figures
            sizes = (self.results.length_text(getattr(f, name)) for name in _AXIS)
            rows.append((run.coordinate, self._at(run.others), f"{len(f.targets)}", f"{f.approaches}", *sizes))
        title = "ISO 230-2: accuracy A, repeatability R, systematic E, mean M, reversal B"
        return Table(title, ("axis", "at", "targets", "approaches", *_AXIS), tuple(rows), left=2) if rows else None

    def _poses(self) -> Table | None:
        rows = []
        for run in self.poses:
            sizes = (self.results.length_text(v) for v in (run.figures.accuracy, run.figures.repeatability))
            rows.append((self._at(run.at), str(run.figures.cycles), *sizes))
        title, heads = "ISO 9283: pose accuracy AP, pose repeatability RP", ("pose", "cycles", "AP", "RP")
        return Table(title, heads, tuple(rows)) if rows else None

    def _circle(self) -> Table | None:
        if self.circle is None:
            return None
        radius, circle = self.circle
        sizes = tuple(self.results.length_text(v) for v in (circle.circular, circle.largest, circle.smallest))
        size, feed = self.results.place_text(radius), self.results.feed
        if feed is not None:
            title = f"ISO 230-4, radius {size}, feed {feed * _MM_PER_MIN:.6g} mm/min"
            return Table(title, ("circular deviation G", "radial deviation Fmax", "Fmin"), (sizes,), left=0)
        title = f"Quasi-static circle, radius {size} (points at rest; not ISO 230-4)"
        return Table(title, ("range of the radii", "largest radial deviation", "smallest"), (sizes,), left=0)

    def _lines(self) -> Table | None:
        rows = [
            (line.coordinate, self._at(line.others), *(self.results.length_text(getattr(line, name)) for name in _LINE))
            for line in self.lines
        ]
        heads = ("axis", "at", *(f"predicted {name}" for name in _LINE))
        title = "Predicted for the machine as built, if the control commands by the nominal parameters "
        title += "(identified model; no repeats: no A, no R)"
        return Table(title, heads, tuple(rows), left=2) if rows else None

    def json(self) -> dict[str, Any]:
        """For programs: lengths in the unit of the sheet, places in that of the machine file."""
        size, unit = self.results.length_unit, self.results.machine.file_units.length

        def at(values: Sequence[tuple[str, float]]) -> dict[str, float]:
            return {name: value / unit.scale for name, value in values}

        def figures(of: object, names: Sequence[str]) -> dict[str, float]:
            return {name: getattr(of, name) / size.scale for name in names}

        circle: dict[str, float | None] | None = None
        if self.circle is not None:
            radius, deviation = self.circle
            feed = None if self.results.feed is None else self.results.feed * _MM_PER_MIN
            sizes = figures(deviation, ("circular", "largest", "smallest"))
            circle = {**sizes, "radius": radius / unit.scale, "feed": feed}
        return {
            "state": self.state,
            "unit": size.text,
            "at_unit": unit.text,
            "axes": [
                {"axis": r.coordinate, "at": at(r.others), "targets": len(r.figures.targets)}
                | {"approaches": r.figures.approaches, **figures(r.figures, _AXIS)}
                for r in self.axes
            ],
            "poses": [
                {"at": at(r.at), "cycles": r.figures.cycles}
                | {"AP": r.figures.accuracy / size.scale, "RP": r.figures.repeatability / size.scale}
                for r in self.poses
            ],
            "circle": circle,
            "predicted": [{"axis": x.coordinate, "at": at(x.others), **figures(x, _LINE)} for x in self.lines],
        }


def acceptance(results: Results) -> Acceptance | None:
    """Of the table measured after correction, where there is one, else of the machine as built; None without positions.

    Deviations are measured - commanded, and the control commands by what it knows: the identified parameters after
    correction, the nominal ones before.
    """
    if results.verified is not None:
        verification, state = results.verified.verification, "after correction"
        problem, values = verification.problem, verification.values
    else:
        problem, values, state = results.calibrated.problem, results.calibrated.fit.before.values, "as built"
    problem = replace(problem, rows=with_sides(problem.rows, problem.model))
    targets = measured_targets(problem, evaluate(problem, values, ()))
    if targets is None:
        return None
    circle = circular(targets)
    axes, (lines, note) = axis_runs(targets), _predicted(results)
    return Acceptance(
        results=results,
        state=state,
        axes=axes,
        poses=pose_runs(targets),
        circle=None if circle is None else (circle[1], circle_deviation(*circle)),
        lines=[] if axes else lines,
        note=note,
    )


def _predicted(results: Results) -> tuple[list[PredictedLine], str]:
    """What the identified model says of lines that nobody measured again and again, and under which conditions."""
    improved, problem, fit = results.improved, results.calibrated.problem, results.calibrated.fit
    if improved is not None and improved.improvement.accepted:
        problem, fit = improved.improvement.problem, improved.improvement.fit
    conditions = at_rest(problem.model, problem.rows.take(slice(0, 1)))
    return predicted_lines(problem, fit.values, conditions), resting(problem.model)
