"""Do intervals hold where ranges and sigmas are wrong and parameters are held? `python -m tests.interval_coverage`.

Writes the table of docs/coverage.md (an hour on two cores); `--count N`: campaigns of every line, at least (250; more
until a line has 2000 intervals); `--only TEXT ...`: lines whose names contain one of these, the others stay as they
are on the page; `--jobs N`: processes.
"""

from __future__ import annotations

import argparse
import re
from collections.abc import Iterator
from concurrent.futures import Executor, ProcessPoolExecutor
from dataclasses import dataclass, replace
from functools import lru_cache
from pathlib import Path

import numpy as np

from pkmcal_cli.base.rotation import Array
from pkmcal_cli.calibration.complete_fit import FitOptions, calibrated
from pkmcal_cli.calibration.identify import RowsFailed
from pkmcal_cli.calibration.problem import Problem
from pkmcal_cli.prediction import Rows
from tests.campaigns import COVER, Plan, shipped
from tests.truth import generate

PAGE = Path(__file__).resolve().parents[1] / "docs" / "coverage.md"
BLOCK = re.compile(r"(<!-- guesses -->\n).*?(<!-- end of guesses -->\n)", re.DOTALL)
HEAD = "| machine | what is wrong | prior | campaigns | intervals | inside % | required | lowest % | std, ranges |"
WILD = 20.0  # half ranges
INTERVALS, MOST = 2000, 4  # intervals of a line, at least; campaigns over what was asked for, at most
BATCH = 25


@dataclass(frozen=True, kw_only=True)
class Case:
    """A line: true offsets over their prior; one wild; which third is held; true sigma over stated, and how it grows
    over the workspace; number of rows, 0 for all; what is required, in percent."""

    machine: str
    text: str
    prior: str = "none"
    factor: float = 1.0
    wild: bool = False
    third: int = -1
    sigma: float = 1.0
    growth: float = 1.0
    rows: int = 0
    required: tuple[float, float] = (93.0, 97.0)

    @property
    def machines(self) -> tuple[str, int, float, bool]:
        """Cases in which these are equal have the same true machines, measured at the same poses."""
        return self.machine, self.rows, self.factor, self.wild

    @property
    def name(self) -> str:
        """By which it can be chosen."""
        return f"{self.machine} {self.text} {self.prior}"


def cases() -> Iterator[Case]:
    """All lines."""
    for machine in ("triglide", "biglide", "delta4", "triglide-nonredundant"):
        for prior in ("none", "ranges"):
            for factor in (1.0, 1.5, 2.0, 3.0):
                required = (93.0, 97.0) if factor == 1 else (91.0, 100.0)
                yield Case(machine=machine, text=f"{factor:g} x range", prior=prior, factor=factor, required=required)
            wild = Case(machine=machine, text="one 10 ranges off", prior=prior, wild=True, required=(93.0, 100.0))
            yield wild
        for third in range(3):
            yield Case(machine=machine, text=f"third {third + 1} held", third=third)
    for machine in ("triglide-nonredundant", "triglide"):
        for rows in (8, 20, 60, 200):
            for sigma, word in ((1.5, "1.5 times too small"), (1.0, "right"), (0.5, "twice too large")):
                text = f"{rows} rows, sigma {word}"
                yield Case(machine=machine, text=text, rows=rows, sigma=sigma, required=(94.0, 96.0))
        yield Case(machine=machine, text="noise 1 : 6 over the workspace", growth=6.0)


@lru_cache(maxsize=4)
def _simulated(machine: str, rows: tuple[int, ...], values: tuple[float, ...]) -> Array:
    """True readings (N, C) at some rows of the machine's plan, or all, once for cases that share them."""
    plan = shipped(machine)
    if not rows:
        return plan.simulate(np.array(values))
    simulator, given = generate.campaigns()[machine].machine, plan.model.by_name(np.array(values))
    truth = simulator.forward(plan.positions[list(rows)], {n: given.get(n, v) for n, v in simulator.nominal.items()})
    return np.asarray(truth.tcp[:, : len(simulator.channels)])


def measured(case: Case, rng: np.random.Generator) -> tuple[Plan, Problem, Array, int]:
    """Plan, problem, true values (P,), place of the wild parameter among the selected, -1 without one."""
    plan = shipped(case.machine)
    some: list[int] = []
    if case.rows:
        some = np.sort(rng.choice(len(plan.positions), case.rows, replace=False)).tolist()
        plan = replace(plan, positions=plan.positions[some])
    offsets, wild = rng.normal(size=len(plan.selected)) * case.factor, -1
    if case.wild:
        wild = int(rng.integers(len(offsets)))
        offsets[wild] = WILD * rng.choice([-1.0, 1.0])
    values = plan.all_drawn(rng)
    values[plan.index] = plan.model.nominal[plan.index] + offsets * plan.ranges / 2
    readings = _simulated(case.machine, tuple(some), tuple(values.tolist()))
    place = readings[:, 0]
    share = (place - place.min()) / np.ptp(place)
    noise = case.sigma * plan.sigma * (1 + (case.growth - 1) * share)[:, None]
    stated = plan.sigma * np.sqrt(((1 + (case.growth - 1) * share) ** 2).mean())
    problem = plan.problem(readings + noise * rng.normal(size=readings.shape), sigma=stated)
    return plan, replace(problem, rows=Rows.at(plan.positions)), values, wild


def campaign(case: Case, seed: int) -> tuple[Array, Array]:
    """Whether intervals hold the true values (p,), nan where there is none, and std (p,) in ranges."""
    rng = np.random.default_rng([11, seed])
    plan, problem, values, wild = measured(case, rng)
    held = {n for k, n in enumerate(plan.selected) if k % 3 == case.third}
    selected = tuple(n for n in plan.selected if n not in held)
    nothing = np.full(len(plan.selected), np.nan)
    options = FitOptions(prior=case.prior)
    try:
        found = calibrated(problem, selected, plan.model.nominal, options, np.zeros(len(problem)))
    except RowsFailed:
        return nothing, nothing
    if found.robust.fit.status != "converged":
        return nothing, nothing
    inside, std = nothing.copy(), nothing.copy()
    for k, name in enumerate(selected):
        place, own = plan.model.names.index(name), plan.selected.index(name)
        error, spread = found.robust.fit.values[place] - values[place], found.intervals.std[k]
        if np.isfinite(spread) and own != wild:
            inside[own], std[own] = abs(error) < COVER * spread, spread / plan.model.ranges[place]
    return inside, std


def _batch(alike: tuple[Case, ...], first: int, count: int) -> tuple[Array, Array]:
    """Inside, std (cases, count, p) of cases with the same machines, one after the other for each of these."""
    parts = [[campaign(case, seed) for case in alike] for seed in range(first, first + count)]
    inside, std = (np.array([[part[k] for part in of_seed] for of_seed in parts]) for k in (0, 1))
    return inside.swapaxes(0, 1), std.swapaxes(0, 1)


def _until_enough(pool: Executor, jobs: int, alike: tuple[Case, ...], count: int) -> tuple[Array, Array]:
    """Inside, std (cases, n, p) of at least `count` campaigns, and so many that each case has enough intervals."""
    parts: list[tuple[Array, Array]] = []
    fewest = 0
    while (done := len(parts) * BATCH) < count or (fewest < INTERVALS and done < MOST * count):
        step = [pool.submit(_batch, alike, done + k * BATCH, BATCH) for k in range(jobs)]
        parts += [future.result() for future in step]
        fewest = int(np.isfinite(np.concatenate([inside for inside, _ in parts], axis=1)).sum(axis=(1, 2)).min())
    inside, std = (np.concatenate([part[k] for part in parts], axis=1) for k in (0, 1))
    return inside, std


def line(case: Case, inside: Array, std: Array) -> str:
    """A row of the table."""
    share = 100 * float(np.nanmean(inside))
    by_parameter = inside[:, ~np.isnan(inside).all(axis=0)]
    lowest = 100 * float(np.nanmin(np.nanmean(by_parameter, axis=0)))
    low, high = case.required
    met = "" if low <= share <= high else " (missed)"
    required = f"{low:g} to {high:g}" if high < 100 else f">= {low:g}"
    ended = int((~np.isnan(inside).all(axis=1)).sum())
    cells = (
        case.machine, case.text, case.prior, ended, int(np.isfinite(inside).sum()), f"{share:.1f}{met}", required,
        f"{lowest:.1f}", f"{np.nanmedian(std):.3f}",
    )  # fmt: skip
    return "| " + " | ".join(str(c) for c in cells) + " |"


def on_page(page: str, lines: list[str]) -> str:
    """The page with lines of cases replaced, and those that it lacks, in order."""
    block = BLOCK.search(page)
    assert block is not None
    told = {_key(text): text for text in [*block[0].splitlines(), *lines] if text.startswith("| ")}
    order = [f"{case.machine} | {case.text} | {case.prior}" for case in cases()]
    made = [HEAD, "|" + "---|" * (HEAD.count("|") - 1), *(told[key] for key in order if key in told)]
    return BLOCK.sub(lambda m: m[1] + "".join(f"{text}\n" for text in made) + m[2], page)


def _key(text: str) -> str:
    """Machine, what is wrong, prior."""
    return " | ".join(text.strip("| ").split(" | ")[:3])


def main() -> None:
    """Measure, print, write."""
    parser = argparse.ArgumentParser(description="Coverage of intervals where what is stated is wrong.")
    parser.add_argument("--count", type=int, default=250)
    parser.add_argument("--only", nargs="+", default=[""])
    parser.add_argument("--jobs", type=int, default=2)
    chosen = parser.parse_args()
    of_machines: dict[tuple[str, int, float, bool], list[Case]] = {}
    for case in cases():
        if any(text in case.name for text in chosen.only):
            of_machines.setdefault(case.machines, []).append(case)
    with ProcessPoolExecutor(chosen.jobs) as pool:
        for alike in of_machines.values():
            inside, std = _until_enough(pool, chosen.jobs, tuple(alike), chosen.count)
            lines = [line(*row) for row in zip(alike, inside, std, strict=True)]
            print("\n".join(lines), flush=True)
            PAGE.write_text(on_page(PAGE.read_text(encoding="utf-8"), lines), encoding="utf-8")


if __name__ == "__main__":
    main()
