"""Planted mistakes are named with the right columns on real campaigns; honest campaigns raise no suspicion."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from itertools import product
from pathlib import Path

import numpy as np
import pytest

from pkmcal_cli.base.rotation import Array
from pkmcal_cli.calibration.measured_problem import problem_of
from pkmcal_cli.calibration.problem import Problem
from pkmcal_cli.gross_errors.gross_faults import gross_faults
from pkmcal_cli.gross_errors.hints import copied_rows, measurement_hints
from pkmcal_cli.gross_errors.plausibility import Hint
from pkmcal_cli.loading.load_machine import load_machine, load_measurements
from pkmcal_cli.prediction import Rows, predict
from tests.campaigns import Plan, by_engine, shipped
from tests.command import MACHINES
from tests.in_ci import in_ci
from tests.support import model, overlay

NAMED = ("triglide", "scissors", "delta4", "hexapod7")
TABLES = sorted(MACHINES.glob("*.csv"))


@dataclass(frozen=True)
class Mistake:
    """What is done to readings (N, C) or to drives (N, A), and the hint that must come of it."""

    kind: str
    names: Callable[[Plan], set[str]]
    channels: Callable[[Array], Array] = np.copy
    drives: Callable[[Array], Array] = np.copy


def columns(*numbers: int) -> Callable[[Plan], set[str]]:
    return lambda plan: {plan.model.channels[k].name for k in numbers}


def drives(*numbers: int) -> Callable[[Plan], set[str]]:
    return lambda plan: {plan.model.actuators[k].name for k in numbers}


def every(plan: Plan) -> set[str]:
    return {a.name for a in plan.model.actuators}


def times(column: int, factor: float) -> Callable[[Array], Array]:
    return lambda table: np.where(np.arange(table.shape[1]) == column, factor * table, table)


def exchanged(table: Array) -> Array:
    return table[:, [1, 0, *range(2, table.shape[1])]]


def later(count: int, start: int = 0) -> Callable[[Array], Array]:
    """Readings that stand `count` rows too low (too high if negative) from a row on."""

    def move(table: Array) -> Array:
        out = np.roll(table, count, axis=0)
        out[:count] = np.nan if count > 0 else out[:count]
        if count < 0:
            out[count:] = np.nan
        return np.concatenate([table[:start], out[start:]])

    return move


MISTAKES = {
    "channels swapped": Mistake("swapped", columns(0, 1), exchanged),
    "channel turned": Mistake("sign", columns(0), times(0, -1)),
    "other channel turned": Mistake("sign", columns(1), times(1, -1)),
    "channel in m": Mistake("unit", columns(0), times(0, 1e-3)),
    "channel in inches": Mistake("unit", columns(1), times(1, 1 / 25.4)),
    "rows one late": Mistake("rows", lambda _: set(), later(1)),
    "rows one early": Mistake("rows", lambda _: set(), later(-1)),
    "rows two late": Mistake("rows", lambda _: set(), later(2)),
    "rows late from the middle": Mistake("rows", lambda _: set(), later(1, 20)),
    "drives rotated": Mistake("rotated", every, drives=lambda q: np.roll(q, 1, axis=1)),
    "drives rotated back": Mistake("rotated", every, drives=lambda q: np.roll(q, -1, axis=1)),
    "drives swapped": Mistake("swapped", drives(0, 1), drives=exchanged),
    "drive turned": Mistake("sign", drives(1), drives=times(1, -1)),
    "drive in m": Mistake("unit", drives(0), drives=times(0, 1e-3)),
    "drives in um": Mistake("unit", every, drives=lambda q: 1e3 * q),
}


QUICK = [
    *(f"triglide-{label}" for label in MISTAKES),
    *(f"{name}-{label}" for name in ("scissors", "delta4") for label in MISTAKES if "drive" not in label),
    "delta4-drives rotated",
]  # fmt: skip
"""Every mistake on the Triglide, those of the readings on two more, those of the drives that are soon found there."""


def measured(name: str, seed: int, size: float, rows: int = 40) -> tuple[Plan, Problem]:
    """A campaign of `rows` rows with errors of standard deviation `size` ranges, and noise."""
    plan, rng = shipped(name), np.random.default_rng(seed)
    count = len(plan.positions)
    plan = by_engine(replace(plan, positions=plan.positions[np.sort(rng.permutation(count)[: min(rows, count)])]))
    values = plan.model.nominal
    values[plan.index] += rng.normal(size=len(plan.selected)) * plan.ranges * size
    return plan, plan.measured(values, rng)


def spoiled(problem: Problem, mistake: Mistake) -> Problem:
    readings = mistake.channels(problem.readings)
    rows = replace(problem.rows, readings=mistake.drives(problem.rows.readings))
    return replace(problem, readings=readings, rows=rows, measured=~np.isnan(readings))


def hints(problem: Problem) -> tuple[Hint, ...]:
    asked = [p.name for p in problem.model.parameters if p.identify]
    rows = np.zeros(len(problem), dtype=np.intp)
    return gross_faults(problem, problem.model.nominal, asked, rows, lambda row: f"row {row + 1}")


def named(plan: Plan, problem: Problem, mistake: Mistake) -> bool:
    """Whether one of the hints names kind and columns."""
    found = hints(spoiled(problem, mistake))
    names = mistake.names(plan)
    return any(h.kind == mistake.kind and (not names or set(h.names) == names) for h in found)


@pytest.mark.parametrize(("name", "label"), in_ci(QUICK, product(NAMED, MISTAKES)))
def test_every_mistake_is_named(name: str, label: str) -> None:
    """With errors of four standard deviations of the prior, to make it harder."""
    plan, problem = measured(name, 3, 2.0)
    assert named(plan, problem, MISTAKES[label])


@pytest.mark.parametrize("step", in_ci(["5"], [5, 1]))
def test_honest_campaigns_raise_no_suspicion(step: int) -> None:
    """200 campaigns, or each fifth, with few or many rows, parameters off by half to ten times their range."""
    alarms, count = [], 0
    machines = {
        "triglide": 40,
        "triglide-nonredundant": 40,
        "biglide": 40,
        "scissors": 40,
        "delta4": 30,
        "hexapod7": 10,
    }
    for name, campaigns in machines.items():
        for seed in range(0, campaigns, step):
            size, rows = (0.5, 2.0, 4.0, 10.0)[seed % 4], 5 + seed
            found = hints(measured(name, 100 + seed, size, rows)[1])
            count += 1
            alarms += [(name, seed, h.message) for h in found]
    assert count == 200 // step and alarms == []


OF_A_SESSION = ("channels swapped", "channel turned", "drive turned", "drives swapped")


@pytest.mark.parametrize(
    ("name", "label"),
    in_ci(
        [*(f"triglide-nonredundant-{label}" for label in OF_A_SESSION), "scissors-channels swapped"],
        product(["scissors", "triglide-nonredundant"], OF_A_SESSION),
    ),
)
def test_a_mistake_of_one_session_is_named_there(name: str, label: str) -> None:
    """The second half of the table is spoiled; hints of the whole would not be explained by it."""
    plan, problem = measured(name, 3, 0.5)
    bad, late = spoiled(problem, MISTAKES[label]), np.arange(len(problem)) >= len(problem) // 2
    both = replace(
        problem,
        readings=np.where(late[:, None], bad.readings, problem.readings),
        rows=replace(problem.rows, readings=np.where(late[:, None], bad.rows.readings, problem.rows.readings)),
    )
    asked = [p.name for p in problem.model.parameters if p.identify]
    found = gross_faults(both, problem.model.nominal, asked, late.astype(np.intp), str, ("morning", "noon"))
    assert (MISTAKES[label].kind, MISTAKES[label].names(plan)) in [(h.kind, set(h.names)) for h in found]
    assert all(h.message.startswith("in session `noon` ") for h in found)


@pytest.mark.parametrize("table", TABLES, ids=lambda t: t.stem)
def test_no_hint_on_any_shipped_table(table: Path) -> None:
    machines = [m for m in MACHINES.glob("*.yaml") if table.name.startswith(m.stem) and ".csv" not in m.name]
    loaded = load_machine(str(max(machines, key=lambda m: len(m.stem))))
    data = load_measurements(loaded, (str(table),))
    problem = problem_of(loaded.model, data)
    assert measurement_hints(loaded, problem, problem.model.nominal, data) == () == copied_rows(problem, data)


# --- other instruments ------------------------------------------------------------------------

BALLBAR = """
parameters: {bx: 30 mm, by: -700 mm, bz: -900 mm}
ground: {ball: [bx, by, bz]}
sensors: {tracker: null, ballbar: {kind: distance, at: platform, offset: [5, 6, -70], to: ball, sigma: 1 um}}
"""
TOUCH = """
parameters: {pz: {nominal: -560 mm, range: 1 mm}}
frames: {bed: {at: [0, 0, pz]}}
sensors:
  tracker: null
  probe: {kind: touch, at: platform, offset: [0, 0, -50], surface: bed, sigma: 5 um}
  side: {kind: touch, at: platform, offset: [0, 10, -50], surface: bed, sigma: 5 um}
"""


def read_by(text: str, seed: int, size: float = 0.5) -> Problem:
    """Readings of other instruments on the delta, at 40 of its poses."""
    machine, rng = model(overlay("delta4", text)), np.random.default_rng(seed)
    rows = Rows.at(shipped("delta4").positions[:40])
    free = np.array([p.identify for p in machine.parameters])
    values = machine.nominal + rng.normal(size=len(free)) * machine.ranges * size * free
    sigma = np.array([c.sigma for c in machine.channels])
    readings = predict(machine, values, rows).values
    readings += sigma * rng.normal(size=readings.shape)
    known = np.ones(readings.shape, dtype=bool)
    drives = np.zeros(rows.readings.shape)
    noise = {"sigma": sigma * known, "drive_sigma": drives}
    return Problem(model=machine, rows=rows, readings=readings, measured=known, **noise)


@pytest.mark.parametrize(
    "label",
    in_ci(
        ["drives rotated", "rows one late", "rows two late"],
        ["drives rotated", "drive turned", "drive in m", "rows one late", "rows two late"],
    ),
)
def test_mistakes_that_one_distance_shows(label: str) -> None:
    """No pose was measured: the drives are predicted again with columns changed."""
    mistake = MISTAKES[label]
    (hint,) = hints(spoiled(read_by(BALLBAR, 1), mistake))
    assert hint.kind == mistake.kind


@pytest.mark.parametrize("size", [0.5, 2.0])
def test_honest_distances_and_touches(size: float) -> None:
    for seed in range(5):
        assert hints(read_by(BALLBAR, seed, size)) == ()
        touched = read_by(TOUCH, seed, size)
        nothing = np.random.default_rng(seed).normal(size=touched.readings.shape) * 5e-6
        poses = touched.rows.readings - (touched.readings.mean(axis=1, keepdims=True))  # lowered until it touches
        assert hints(replace(touched, readings=nothing, rows=Rows.at(poses))) == ()


def fitted(change: Callable[[Array], Array]) -> tuple[str, ...]:
    """Hints on the delta's table, seen by a tracker that stands anywhere, after a change of its readings (N, 3)."""
    loaded = load_machine(str(MACHINES / "delta4.yaml"))
    data = load_measurements(loaded, (str(MACHINES / "delta4.csv"),))
    machine = model(overlay("delta4", "sensors: {tracker: {frame: fitted}}"))
    about = np.array([[0.0, -1.0, 0.0], [0.6, 0.0, -0.8], [0.8, 0.0, 0.6]])
    problem = problem_of(machine, replace(data, readings=change(data.readings @ about.T + [2.5, -1.2, 0.7])))
    return tuple(h.message for h in hints(problem))


def test_instruments_that_stand_anywhere() -> None:
    assert fitted(np.copy) == ()
    for change in (times(1, -1), exchanged):
        (message,) = fitted(change)
        assert message.startswith("`x`, `y`, `z` look mirrored (one axis reversed in sign, or two columns swapped)")
    assert fitted(times(2, 1e-3))[0].startswith("`z` looks 1000 times too small (is it in `m`, not `mm`, or")
    assert fitted(later(1))[0].startswith("the readings look shifted by one row")
