"""Does `compare` alarm as often as it says, and does it name what has changed? `python -m tests.compare_campaigns`.

Pairs of calibrations of machines that the independent simulator measures: other poses, another selection, another
datum, an instrument that stands elsewhere. Writes the tables of docs/verify-and-compare.md; `--null N`, `--changed N`:
numbers of pairs.
"""

from __future__ import annotations

import argparse
import re
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path

import numpy as np

from pkmcal_cli.base.rotation import Array
from pkmcal_cli.calibration.comparison import (
    Alone,
    Changes,
    Omnibus,
    alone,
    changed,
    changes,
    chosen_by_all,
    omnibus,
)
from pkmcal_cli.calibration.complete_fit import FitOptions, calibrated
from pkmcal_cli.calibration.data_sets import common
from pkmcal_cli.calibration.determinacy import determinacy
from pkmcal_cli.calibration.frame_start import with_frames
from pkmcal_cli.calibration.information import data_information
from pkmcal_cli.calibration.problem import Problem
from pkmcal_cli.calibration.selection import select
from pkmcal_cli.loading.data_information import DataInformation
from pkmcal_cli.model.model import Model
from tests.campaigns import shipped
from tests.command import MACHINES
from tests.support import compiled
from tests.truth import generate

PAGE = Path(__file__).resolve().parents[1] / "docs" / "verify-and-compare.md"
BLOCK = re.compile(r"(<!-- campaigns -->\n).*?(<!-- end of campaigns -->\n)", re.DOTALL)


@dataclass(frozen=True)
class Subject:
    """A machine that is calibrated twice: selections and datums that calibrations draw from; which strut may change.

    anywhere: whether its tracker stands elsewhere each time.
    """

    machine: str
    selections: tuple[str, ...]
    datums: tuple[tuple[str, ...], ...]
    struts: tuple[str, ...]
    rows: int
    anywhere: bool = False


SUBJECTS = (
    Subject("biglide", ("auto", "auto,k1", "auto,-xb1r", "all", "auto,-y8,-l3"), ((),), ("l1", "l2", "l3"), 40),
    Subject(
        "triglide", ("auto", "auto,gamma", "auto,gamma,-yb1r", "all", "auto,-xb3r"),
        (("gamma",), ("yb1r",), ("yb3r", "gamma"), ("xb1r", "yb1r", "gamma")), ("l1", "l2", "l3"), 40, anywhere=True,
    ),
    Subject("scissors", ("auto", "auto,d1", "all", "auto,-g1", "auto,xa3,yb3"), ((),), ("l3", "l4"), 40),
)  # fmt: skip


@cache
def model_of(subject: Subject) -> Model:
    """The machine, its tracker anywhere where it stands elsewhere each time."""
    plan = shipped(subject.machine)
    if not subject.anywhere:
        return plan.model
    return compiled(f"extends: {MACHINES}/{subject.machine}.yaml\nsensors: {{tracker: {{frame: fitted}}}}\n").model


@dataclass(frozen=True)
class Calibrated:
    """One calibration: what its rows say, its values and std by name, what it identified, its datum."""

    data: DataInformation
    values: dict[str, float]
    std: dict[str, float]
    chosen: tuple[str, ...]
    datum: tuple[str, ...]


def calibration(subject: Subject, true: Array, rng: np.random.Generator) -> Calibrated:
    """Of a machine with parameter values (P,) of its shipped file, by poses, a selection and a datum that are drawn."""
    plan, model = shipped(subject.machine), model_of(subject)
    machine = generate.campaigns()[subject.machine].machine
    rows = np.sort(rng.choice(len(plan.positions), subject.rows, replace=False))
    given = plan.model.by_name(true)
    positions, planted = plan.positions[rows], {n: given.get(n, v) for n, v in machine.nominal.items()}
    readings = machine.forward(positions, planted).tcp[:, : len(machine.channels)]
    if subject.anywhere:
        turn, shift = rng.uniform(-3, 3), rng.uniform(-1, 1, 2)
        readings = readings @ np.array([[np.cos(turn), np.sin(turn)], [-np.sin(turn), np.cos(turn)]]) + shift
    readings = readings + rng.normal(size=readings.shape) * plan.sigma
    problem = replace(plan, positions=positions).problem(readings)
    datum = subject.datums[rng.integers(len(subject.datums))]
    model = replace(model, datum=tuple(datum))
    problem = replace(problem, model=with_frames(model, problem.rows, readings))
    return fitted(problem, subject.selections[rng.integers(len(subject.selections))])


def fitted(problem: Problem, text: str) -> Calibrated:
    """A calibration as `calibrate` does it."""
    start = problem.model.nominal
    asked = determinacy(problem, start, select(problem.model, text))
    found = calibrated(problem, asked.selected, start, FitOptions(), np.zeros(len(problem)), asked.datum)
    fit = found.robust.fit
    data = data_information(problem, fit, found.budget)
    assert data is not None and fit.status == "converged"
    values = dict(zip(problem.model.names, fit.values.tolist(), strict=True))
    std = dict(zip(fit.selected, found.intervals.std.tolist(), strict=True))
    return Calibrated(data, values, std, fit.selected, problem.model.datum)


@dataclass(frozen=True)
class Compared:
    """What `compare` says of two calibrations."""

    test: Omnibus
    changes: Changes
    alone: Alone | None


def compared(one: Calibrated, other: Calibrated) -> Compared:
    """Two calibrations, frames of instruments left out."""
    both = (one, other)
    frames = [{n for n in c.data.names if n.startswith("frame@")} for c in both]
    c = common([x.data for x in both], [x.values for x in both], frames)
    test, contrasts = omnibus(c)
    moved, times = chosen_by_all(c, [x.chosen for x in both]), (0.0, 1.0)
    return Compared(test, changes(c, moved, times, test.freedom), alone(c, contrasts, test, times))


def null_pair(subject: Subject, seed: int) -> Compared:
    """Two calibrations of one machine."""
    rng = np.random.default_rng([21, seed])
    true = shipped(subject.machine).all_drawn(rng)
    return compared(calibration(subject, true, rng), calibration(subject, true, rng))


def changed_pair(subject: Subject, seed: int) -> tuple[str, Compared]:
    """A strut, and two calibrations between which it changes by 5 of the standard uncertainties of its change.

    One that both determine, where there is one; else by 5 of those that the first calibration states, or half ranges.
    """
    rng = np.random.default_rng([22, seed])
    model = shipped(subject.machine).model
    true = shipped(subject.machine).all_drawn(rng)
    before, second = calibration(subject, true, rng), int(rng.integers(2**32))
    unchanged = compared(before, calibration(subject, true, np.random.default_rng(second))).changes
    known = dict(zip(unchanged.names, zip(unchanged.determined, unchanged.std, strict=True), strict=True))
    seen = [n for n in subject.struts if np.isfinite(before.std.get(n, np.nan))]
    struts = [n for n in subject.struts if n in known and known[n][0]] or seen or list(subject.struts)
    strut = str(rng.choice(struts))
    half = 0.5 * float(model.ranges[model.names.index(strut)])
    std = known[strut][1] if strut in known and known[strut][0] else before.std[strut] if strut in seen else half
    true[model.names.index(strut)] += 5 * std * rng.choice([-1.0, 1.0])
    return strut, compared(before, calibration(subject, true, np.random.default_rng(second)))


HEAD = """| machine | pairs | alarms at 5 % | at 1 % | a parameter named (Holm, 5 %) | mean F |
| --- | --- | --- | --- | --- | --- |"""
CHANGED = """| machine | pairs | lost | alarms at 5 % | named | only that | by its own test, where determined |
| --- | --- | --- | --- | --- | --- | --- |"""


def named(c: Compared) -> tuple[str, ...]:
    """What `compare` names at 5 %."""
    return changed(c.changes, c.alone, c.test, 0.05)


def null_line(subject: Subject, count: int) -> tuple[str, list[float]]:
    """A row of the table of unchanged machines, and its p values."""
    found = [null_pair(subject, seed) for seed in range(count)]
    p_values = [c.test.p_value for c in found]
    by_own = [c.test.p_value < 0.05 and bool((c.changes.holm < 0.05).any()) for c in found]
    chi2 = np.mean([c.test.statistic for c in found])
    p = np.array(p_values)
    shares = " | ".join(f"{100 * np.mean(x):.1f} %" for x in (p < 0.05, p < 0.01, by_own))
    return f"| {subject.machine} | {count} | {shares} | {chi2:.3f} |", p_values


def changed_line(subject: Subject, count: int) -> str:
    """A row of the table of changed machines; `lost`: pairs of which the independent simulator found no pose."""
    found: list[tuple[str, Compared]] = []
    lost, seed = 0, 0
    while len(found) < count:
        try:
            found.append(changed_pair(subject, seed))
        except np.linalg.LinAlgError:
            lost += 1
        seed += 1
    told = [(s, named(c)) for s, c in found]
    alarms, right = [c.test.p_value < 0.05 for _, c in found], [s in names for s, names in told]
    p_values = [dict(zip(c.changes.names, c.changes.holm, strict=True)).get(s, np.nan) for s, c in found]
    known = np.array(p_values)[np.isfinite(p_values)]
    shares = " | ".join(f"{100 * np.mean(x):.1f} %" for x in (alarms, right, [names == (s,) for s, names in told]))
    by_holm = f"{100 * np.mean(known < 0.05):.1f} % of {len(known)}" if len(known) else "-"
    return f"| {subject.machine} | {count} | {lost} | {shares} | {by_holm} |"


def table(null: int, changed: int) -> str:
    """Both tables, pairs shared out among the machines."""
    lines, p_values = [HEAD], list[float]()
    for k, subject in enumerate(SUBJECTS):
        line, some = null_line(subject, null // len(SUBJECTS) + (k < null % len(SUBJECTS)))
        lines, p_values = [*lines, line], [*p_values, *some]
    five, one = (100 * float(np.mean(np.array(p_values) < alpha)) for alpha in (0.05, 0.01))
    lines += [f"| all | {len(p_values)} | {five:.1f} % | {one:.1f} % | | |", "", CHANGED]
    for subject in SUBJECTS:
        lines.append(changed_line(subject, changed))
    return "\n".join(lines) + "\n"


def main() -> None:
    """Measure, print, write."""
    parser = argparse.ArgumentParser(description="Level and power of `compare`.")
    parser.add_argument("--null", type=int, default=2000)
    parser.add_argument("--changed", type=int, default=200)
    given = parser.parse_args()
    text = table(given.null, given.changed)
    print(text)
    PAGE.write_text(BLOCK.sub(lambda m: m[1] + text + m[2], PAGE.read_text(encoding="utf-8")), encoding="utf-8")


if __name__ == "__main__":
    main()
