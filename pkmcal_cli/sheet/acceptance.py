"""Figures of acceptance standards, by their names only where what they ask for was measured."""

from __future__ import annotations

from dataclasses import replace

from pkmcal_cli.calibration.positioning_accuracy import FEWEST_APPROACHES, FEWEST_TARGETS, circle_deviation
from pkmcal_cli.calibration.predicted_lines import predicted_lines
from pkmcal_cli.calibration.repeated_targets import (
    AxisRun,
    MeasuredTargets,
    PoseRun,
    axis_runs,
    circular,
    measured_targets,
    pose_runs,
)
from pkmcal_cli.calibration.residual import evaluate
from pkmcal_cli.loading.covariates import at_rest, with_directions
from pkmcal_cli.sheet.content import Block, Section, Table, Text, section
from pkmcal_cli.sheet.results import Results

_MM_PER_MIN = 60e3  # of 1 m/s


def acceptance(results: Results) -> Section | None:
    """ISO 230-2, ISO 230-4 and ISO 9283 of the last table that was measured; None without positions."""
    found = _targets(results)
    if found is None:
        return None
    targets, which = found
    blocks: list[Block] = []
    if axes := axis_runs(targets):
        blocks.append(_axes(results, axes))
    if poses := pose_runs(targets):
        blocks.append(_poses(results, poses))
    if circle := _circle(results, targets):
        blocks.append(circle)
    if not axes:
        text = f"No ISO 230-2 figures: they need {FEWEST_APPROACHES} approaches from each side to each of at least "
        text += f"{FEWEST_TARGETS} targets in a line along one coordinate."
        blocks.append(Text(text, "note"))
        if predicted := _predicted(results):
            blocks.append(predicted)
    return section("acceptance", f"Acceptance figures ({which})", blocks)


def _targets(results: Results) -> tuple[MeasuredTargets, str] | None:
    """Targets of the table measured after correction, where there is one, else of the machine as it was built."""
    if results.verified is not None:
        problem, values, which = results.verified.found.problem, results.verified.found.values, "after correction"
    else:
        report = results.calibrated
        problem, values, which = report.problem, report.fit.before.values, "as built"
    rows = with_directions(problem.rows, [a.name for a in problem.model.actuators])
    problem = replace(problem, rows=rows)
    targets = measured_targets(problem, evaluate(problem, values, ()))
    return None if targets is None else (targets, which)


def _axes(results: Results, runs: list[AxisRun]) -> Table:
    rows = []
    for run in runs:
        f = run.figures
        at = ", ".join(f"{n} = {results.place_text(v)}" for n, v in run.others)
        sizes = (results.length_text(v) for v in (f.A, f.R, f.E, f.M, f.B))
        rows.append((run.coordinate, at, f"{len(f.targets)}", f"{f.approaches}", *sizes))
    heads = ("axis", "at", "targets", "approaches", "A", "R", "E", "M", "B")
    return Table("ISO 230-2: accuracy A, repeatability R, systematic E, mean M, reversal B", heads, tuple(rows), left=2)


def _predicted(results: Results) -> Table | None:
    """What the identified model says of lines that nobody measured again and again."""
    improved = results.improved
    if improved is not None and improved.improvement.accepted:
        problem, fit = improved.improvement.problem, improved.improvement.fit
    else:
        problem, fit = results.calibrated.problem, results.calibrated.fit
    rest = at_rest(problem.model, problem.rows.take(slice(0, 1)))
    rows = []
    for line in predicted_lines(problem, fit.values, rest):
        at = ", ".join(f"{n} = {results.place_text(v)}" for n, v in line.others)
        rows.append((line.coordinate, at, *(results.length_text(v) for v in (line.E, line.M, line.B))))
    heads = ("axis", "at", "predicted E", "predicted M", "predicted B")
    title = "Predicted by the identified model for commands by nominal parameters (no repeats: no A, no R)"
    return Table(title, heads, tuple(rows), left=2) if rows else None


def _poses(results: Results, runs: list[PoseRun]) -> Table:
    rows = []
    for run in runs:
        at = ", ".join(f"{n} = {results.place_text(v)}" for n, v in run.at)
        sizes = results.length_text(run.figures.accuracy), results.length_text(run.figures.repeatability)
        rows.append((at, str(run.figures.cycles), *sizes))
    return Table("ISO 9283: pose accuracy AP, pose repeatability RP", ("pose", "cycles", "AP", "RP"), tuple(rows))


def _circle(results: Results, targets: MeasuredTargets) -> Block | None:
    """The circular deviation; by the standard's name only where the path was run at a feed."""
    found = circular(targets)
    if found is None:
        return None
    path, radius = found
    circle = circle_deviation(path, radius)
    sizes = tuple(results.length_text(v) for v in (circle.circular, circle.largest, circle.smallest))
    size = results.place_text(radius)
    if results.feed is not None:
        title = f"ISO 230-4, radius {size}, feed {results.feed * _MM_PER_MIN:.6g} mm/min"
        heads: tuple[str, ...] = ("circular deviation G", "radial deviation Fmax", "Fmin")
    else:
        title = f"Quasi-static circle, radius {size} (points at rest; not ISO 230-4)"
        heads = ("range of the radii", "largest radial deviation", "smallest")
    return Table(title, heads, (sizes,), left=0)
