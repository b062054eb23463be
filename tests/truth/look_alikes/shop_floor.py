"""Tables of a shop's morning: a drive that drifts while the shop warms, and rows that nothing predicts. SI units.

Both machines are those of `tests.truth.campaigns`; drives are read in whole counts, readings in whole digits.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from tests.truth.campaigns import Campaign, Planted, Scenario, campaign
from tests.truth.dimensions import MM
from tests.truth.pinned import Array

from .look_alike import LookAlike, counted, noise, sessions, table_text

MACHINES = Path(__file__).resolve().parents[3] / "machines"
COUNT, DIGITS = 1e-6, {"triglide": 1e-6, "scissors": 0.1e-6}


def drifting_drive(seed: int, extra: float = 1.0) -> LookAlike:
    """The zero of one drive of the Triglide settles by some 80 um over a morning in which the shop warms by 5 K.

    `extra` 0: in proportion to time, as the catalogue has it.
    """
    rng = np.random.default_rng([seed, 3])
    drive = f"q{1 + seed % 2}"
    drift = float(rng.choice([-1, 1]) * rng.uniform(30e-6, 50e-6))
    planted = [Planted("zero_drift", drive, {"o1": drift})]
    scenario = Scenario(swing=0.15, warming=5.0, hours=4.0, sessions=1, payload=3.0, extra=extra)
    return _look_alike(
        _Plan("triglide", planted, scenario, ((90, 40), (30, 10))),
        seed,
        causes=((f"zero_drift@{drive}",),),
        declared=f"effects: {{zero_drift@{drive}: {{o1: {{value: 0, range: 200 um}}, o2: {{value: 0, range: 100 um}}, "
        "during: [0, 14400]}}\n",
        values={f"zero_drift@{drive}.o1": drift},
    )


def odd_rows(seed: int) -> LookAlike:
    """Two rows of the Scissors were written down wrongly; in every other table a drive has lost motion besides."""
    rng = np.random.default_rng([seed, 4])
    drive = f"q{1 + seed // 2 % 4}"
    lost = float(rng.uniform(10e-6, 16e-6))
    planted = [Planted("backlash", drive, {"b": lost})] if seed % 2 else []
    plan = _Plan("scissors", planted, Scenario(sessions=1, payload=3.0), ((45, 25), (20, 10)))
    return _look_alike(
        plan,
        seed,
        causes=tuple((f"backlash@{p.at}",) for p in planted),
        declared="effects: {"
        + ", ".join(f"backlash@{p.at}: {{b: {{value: 0, range: 60 um}}}}" for p in planted)
        + "}\n",
        values={f"backlash@{p.at}.b": lost for p in planted},
        misread=True,
    )


@dataclass(frozen=True)
class _Plan:
    """A machine, what is planted in it, how it is measured, and rows of each session of the table and of fresh ones."""

    machine: str
    planted: list[Planted]
    scenario: Scenario
    rows: tuple[tuple[int, ...], tuple[int, ...]]

    def measured(self, seed: int, stream: int) -> Campaign:
        """The table (stream 0), or fresh rows of the same day."""
        scenario = replace(self.scenario, stream=stream)
        return campaign(self.machine, self.planted, seed, sum(self.rows[stream]), scenario)


def _look_alike(
    plan: _Plan,
    seed: int,
    *,
    causes: tuple[tuple[str, ...], ...],
    declared: str,
    values: Mapping[str, float],
    misread: bool = False,
) -> LookAlike:
    """The campaign of a plan; `misread`: two rows are not what was measured."""
    rng = np.random.default_rng([seed, 5])
    table, fresh = plan.measured(seed, 0), plan.measured(seed, 1)
    digit = DIGITS[plan.machine]
    texts, bad = {}, frozenset[int]()
    for name, there, counts in (("table", table, plan.rows[0]), ("fresh", fresh, plan.rows[1])):
        q = counted(there.conditions.q, COUNT)
        read = counted(there.true_readings + there.sigma * noise(rng, there.true_readings.shape), digit)
        if misread and name == "table":
            bad = _misread(q, read, rng)
        texts[name] = _table(there, counts, q, read, 4)
    texts["exact"] = _table(fresh, plan.rows[1], fresh.conditions.q, fresh.true_readings, 9)
    return LookAlike(
        machine=(MACHINES / f"{plan.machine}.yaml").read_text(encoding="utf-8"),
        causes=causes,
        declared=declared,
        values=dict(table.parameters) | dict(values),
        bad=bad,
        **texts,
    )


def _misread(q: Array, read: Array, rng: np.random.Generator) -> frozenset[int]:
    """Spoils two rows in place: a drive's hundred millimetres, and a reading's millimetre; returns them."""
    first, second = (int(k) for k in rng.choice(len(q), size=2, replace=False))
    q[first, rng.integers(q.shape[1])] += rng.choice([-1, 1]) * 100 * MM
    read[second, rng.integers(read.shape[1])] += rng.choice([-1, 1]) * rng.integers(1, 9) * MM
    return frozenset((first, second))


def _table(there: Campaign, counts: tuple[int, ...], q: Array, read: Array, digits: int) -> str:
    numbers = there.columns()
    head = {k: v for k, v in numbers.items() if k.split(" ")[0] in ("time", "T") or k.startswith("dir.")}
    head = {"session": sessions(counts)} | head
    drives = [k for k in numbers if k.startswith("q")]
    drive = {k: q[:, i] / MM for i, k in enumerate(drives)}
    channels = {f"{axis} [mm]": read[:, i] / MM for i, axis in enumerate("xyz"[: read.shape[1]])}
    return table_text(head | drive | channels, digits)
