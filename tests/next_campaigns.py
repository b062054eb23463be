"""Rows that `plan --next` takes, by the independent simulator: `python -m tests.next_campaigns [RUNS]`.

A Triglide without redundancy, from nine even points on, until l1 is known to 25 um. Each proposal is measured by the
simulator and added to the table; where the tool advises `improve`, one goes on with the machine that this writes.
Compared with an even grid, and with a fixed D-optimal plan that knows beforehand what will happen: what is not declared
counts as noise there, or is declared from the start. It would stop too early if the true error were beyond 1.96 times
what is wanted in more than 5 % of runs. What it is compared with are medians of every fourth run. Without argument 200
runs of each case (two hours and a half of processor time).
With `least` instead: rows below which no plan can be, by the c-optimal design of points in the box (Elfving 1952).
"""

from __future__ import annotations

import sys
import tempfile
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from pkmcal_cli.base.rotation import Array
from pkmcal_cli.calibration.complete_fit import FitOptions, calibrated
from pkmcal_cli.calibration.problem import design_problem
from pkmcal_cli.calibration.residual import evaluate, linearise
from pkmcal_cli.diagnosis.experiment_design import Aim, best_points, whitened_blocks, with_rows
from pkmcal_cli.diagnosis.linear import linear_problem
from pkmcal_cli.loading.load_machine import LoadedMachine, load_machine
from pkmcal_cli.prediction import Rows
from pkmcal_cli.report.console import Reporter
from pkmcal_cli.workflow.candidate_points import candidate_points
from pkmcal_cli.workflow.next_points import next_points
from tests.command import MACHINES, run
from tests.truth.generate import campaigns, grid

NAME, LIMIT, SIGMA, BUDGET, RUNS = "l1", 25e-6, 10e-6, 400, 200
_ITERATIONS = 3000  # of the multiplicative algorithm (Titterington 1976)
POOL = 3000  # candidates of the plan that knows
LEAD = 5e-3  # m
_ONCE = "{c2: {identify: false}, s2: {identify: false}}"  # per turn: who knows of it knows that, too
MACHINE = str(MACHINES / "triglide-nonredundant.yaml")
BOX = ((200.0, 700.0), (160.0, 390.0))  # mm


@dataclass(frozen=True)
class Case:
    """What happens: noise as many times larger than stated, share of poses that cannot be measured.

    pitch: amplitude, m, of an error of both screws that the machine file does not declare, once in `LEAD`; declared:
    what the file of one who knows of it says.
    """

    name: str
    noise: float = 1.0
    lost: float = 0.0
    pitch: float = 0.0
    declared: str = ""

    def moved(self, readings: Array) -> Array:
        """Where the nuts are at readings (N, 2), m."""
        return np.asarray(readings + self.pitch * np.sin(2 * np.pi * readings / LEAD))

    def scatter(self) -> float:
        """What one who knows all counts as noise, in stated ones: that of the instrument and what the screws do."""
        machine = campaigns()["triglide-nonredundant"].machine
        readings = machine.inverse(grid((*BOX[0], 20), (*BOX[1], 20)))
        off = (machine.forward(self.moved(readings), {}).tcp - machine.forward(readings, {}).tcp)[:, :2]
        return float(np.hypot(self.noise, np.sqrt(np.mean(off**2)) / SIGMA))


CASES = (
    Case("as stated"), Case("noise twice as large", noise=2.0), Case("15 % of the poses unreachable", lost=0.15),
    Case("screws that wobble by 15 um, undeclared", pitch=15e-6,
         declared=f"effects: {{pitch@q1: {_ONCE}, pitch@q2: {_ONCE}}}"),
)  # fmt: skip


@dataclass(frozen=True)
class Run:
    """Rows that were tried when it stopped, also those at which nothing could be measured; status; true error, m."""

    rows: int
    status: str
    error: float


def measured(readings: Array, case: Case, seed: int, true: dict[str, float], rng: np.random.Generator) -> Array:
    """What the instrument reads (N, 2), m; nan where nothing can be measured."""
    machine = campaigns()["triglide-nonredundant"].machine
    out = machine.forward(case.moved(readings), true).tcp[:, :2] + rng.normal(0, case.noise * SIGMA, (len(readings), 2))
    blind = np.random.default_rng([seed, 7]).uniform([[b[0] for b in BOX]], [[b[1] for b in BOX]], (1, 2)) * 1e-3
    size = np.array([b[1] - b[0] for b in BOX]) * 1e-3 * np.sqrt(case.lost)
    out[(np.abs(out - blind) < size / 2).all(axis=1)] = np.nan
    return np.asarray(out)


def table(readings: Array, values: Array) -> str:
    """A table as an engineer writes it; empty cells where nothing was measured."""
    lines = ["q1 [mm],q2 [mm],x [mm],y [mm]"]
    for row, (x, y) in zip(readings, values, strict=True):
        cells = ["", ""] if np.isnan(x) else [f"{1e3 * x:.6f}", f"{1e3 * y:.6f}"]
        lines.append(",".join([*(f"{1e3 * q:.6f}" for q in row), *cells]))
    return "\n".join([*lines, ""])


def machine_file(file: Path, more: str = "") -> str:
    """The machine with the box of the even grids as its workspace, so that nobody measures elsewhere."""
    x, y = BOX
    box = f"{{x: [{x[0]:g}, {x[1]:g}], y: [{y[0]:g}, {y[1]:g}]}}"
    lead = "actuators: {q1: {period: 5 mm}, q2: {period: 5 mm}}"
    file.write_text(f"extends: {MACHINE}\nworkspace: {{box: {box}}}\n{lead}\n{more}\n", encoding="utf-8")
    return str(file)


def drawn_machine(rng: np.random.Generator) -> dict[str, float]:
    """True parameters, SI."""
    nominal = campaigns()["triglide-nonredundant"].machine.nominal
    return {n: v + rng.normal(0, 0.05e-3) for n, v in nominal.items() if n[0] in "lxy"}


def improved(machine: str, file: Path) -> str:
    """The machine with what `improve` adds to it, as its file; the same where it adds nothing."""
    target = file.with_suffix(f".{file.stat().st_size}.yaml")
    done = run("improve", machine, file, "-o", target, "--json", "-q")
    return str(target) if any(step["accepted"] for step in done.json["steps"]) else machine


def grown(case: Case, seed: int, folder: Path) -> Run:
    """One table that grows until the tool says stop, by one who follows its advice."""
    machine, rng = campaigns()["triglide-nonredundant"].machine, np.random.default_rng(seed)
    true = drawn_machine(rng)
    readings = machine.inverse(grid((*BOX[0], 3), (*BOX[1], 3)))
    values, file = measured(readings, case, seed, true, rng), folder / f"{seed}.csv"
    asked, tried = machine_file(folder / "boxed.yaml"), 0
    while True:
        file.write_text(table(readings, values), encoding="utf-8")
        found = next_points(
            machine=asked, table=str(file), parameters=None, select="auto", aim=f"{NAME} {1e6 * LIMIT:g} um",
            budget=BUDGET, seed=seed, to=Reporter(True),
        )  # fmt: skip
        if found.status != "continue":
            break
        if found.advice == "improve" and tried < len(readings):
            tried, before = len(readings), asked
            if (asked := improved(asked, file)) != before:
                continue
        more = np.round(found.added.points.rows.readings, 9)
        readings = np.vstack([readings, more])
        values = np.vstack([values, measured(more, case, seed, true, rng)])
    return Run(len(readings), found.status, found.value - true[NAME])


@dataclass(frozen=True)
class Knowing:
    """One who knows the machine, its noise and where nothing can be measured, and calibrates as the tool does."""

    loaded: LoadedMachine
    case: Case
    seed: int
    true: dict[str, float]

    @classmethod
    def of(cls, case: Case, seed: int, folder: Path, declared: str = "") -> Knowing:
        """With the machine file that states the noise as it is: what the screws do undeclared counts as noise."""
        noise = case.noise if declared else case.scatter()
        known = f"sensors: {{tracker: {{sigma: {1e6 * SIGMA * noise:g} um, sigma_is: exact}}}}\n{declared}"
        file = machine_file(folder / f"knowing{seed}.yaml", known)
        return cls(load_machine(file), case, seed, drawn_machine(np.random.default_rng(seed)))

    @property
    def values(self) -> Array:
        """True parameter values (P,)."""
        model = self.loaded.model
        return np.array([self.true.get(n, v) for n, v in zip(model.names, model.nominal, strict=True)])

    @property
    def selected(self) -> tuple[str, ...]:
        """What is calibrated."""
        return tuple(p.name for p in self.loaded.model.parameters if p.identify)

    def std(self, readings: Array) -> float:
        """What the calibration of a table says of the parameter, m."""
        rng = np.random.default_rng([self.seed, len(readings)])
        values = measured(readings, self.case, self.seed, self.true, rng)
        seen = ~np.isnan(values[:, 0])
        problem = replace(design_problem(self.loaded.model, Rows.at(readings[seen])), readings=values[seen])
        fit = calibrated(problem, self.selected, problem.model.nominal, FitOptions(), np.zeros(len(problem)))
        return float(fit.intervals.std[fit.robust.fit.selected.index(NAME)])

    def even(self) -> int:
        """Rows of the least even grid that does."""
        machine = campaigns()["triglide-nonredundant"].machine
        sizes = [(k, m) for k in range(3, 30) for m in (k, k + 1)]
        return next(k * m for k, m in sizes if self.std(machine.inverse(grid((*BOX[0], k), (*BOX[1], m)))) <= LIMIT)

    def fixed(self) -> int:
        """Rows of the same nine points and the fewest points that do, in the order of their gain for the parameter."""
        start = campaigns()["triglide-nonredundant"].machine.inverse(grid((*BOX[0], 3), (*BOX[1], 3)))
        first = design_problem(self.loaded.model, Rows.at(start[self.seen(start)]))
        pool, _ = candidate_points(self.loaded, first, self.values, POOL, self.seed)
        pool = pool.take(np.nonzero(self.seen(pool.rows.readings))[0])
        linear = linear_problem(with_rows(first, pool), self.values, self.selected, [], None)
        blocks = whitened_blocks(linear, len(first) + len(pool))
        aim = Aim("determine", ((NAME,),))
        order = best_points(linear, blocks, len(first), aim, BUDGET, exchange=False).rows
        added = pool.rows.readings[order]
        return next(len(start) + k for k in range(BUDGET) if self.std(np.vstack([start, added[:k]])) <= LIMIT)

    def least(self) -> float:
        """Rows that the best design of a very fine grid needs, were they as many as one likes of a row's parts."""
        machine, model = campaigns()["triglide-nonredundant"].machine, self.loaded.model
        readings = machine.inverse(grid((*BOX[0], 40), (*BOX[1], 40)))
        problem = design_problem(model, Rows.at(readings[self.seen(readings)]))
        near = linearise(problem, evaluate(problem, self.values, self.selected))
        ranges = np.array([p.range for p in model.parameters if p.name in self.selected])
        rows = (near.jacobian * ranges).reshape(len(problem), -1, len(ranges))  # (N, C, p)
        about, share = np.einsum("nci,ncj->nij", rows, rows), np.full(len(rows), 1 / len(rows))
        wanted = np.array(self.selected) == NAME
        for _ in range(_ITERATIONS):
            per_row = np.linalg.solve(np.einsum("n,nij->ij", share, about), wanted.astype(float))
            share *= np.sqrt(np.einsum("i,nij,j->n", per_row, about, per_row))
            share /= share.sum()
        return float(per_row @ wanted) * (float(ranges @ wanted) / LIMIT) ** 2

    def seen(self, readings: Array) -> NDArray[np.bool_]:
        """Whether something can be measured (N,)."""
        values = measured(readings, self.case, self.seed, self.true, np.random.default_rng(0))
        return np.asarray(~np.isnan(values[:, 0]))


HEAD = """
| case | rows, median | of an even grid | of a fixed plan that knows | error, rms | beyond 1.96 x 25 um | runs |
| --- | --- | --- | --- | --- | --- | --- |"""


def of_run(case: Case, seed: int) -> Run:
    """A run with files of its own, for a pool of processes."""
    with tempfile.TemporaryDirectory() as folder:
        return grown(case, seed, Path(folder))


def of_knowing(case: Case, seed: int) -> tuple[int, ...]:
    """Rows of the even grid, of the fixed plan, and of one that declares what is missing, if anything is."""
    with tempfile.TemporaryDirectory() as folder:
        knowing = Knowing.of(case, seed, Path(folder))
        rows = (knowing.even(), knowing.fixed())
        return (*rows, Knowing.of(case, seed, Path(folder), case.declared).fixed()) if case.declared else rows


def line(case: Case, runs: int) -> str:
    """A row of the table."""
    with ProcessPoolExecutor() as pool:
        knowing = list(pool.map(of_knowing, [case] * max(runs // 4, 1), range(runs)))
        found = list(pool.map(of_run, [case] * runs, range(runs)))
    even, *fixed = np.median(knowing, axis=0)
    rows, error = np.median([r.rows for r in found]), np.array([r.error for r in found])
    early = np.mean([r.status == "reached" and abs(r.error) > 1.96 * LIMIT for r in found])
    of_fixed = "; declared ".join(f"{rows / f:.2f} ({f:g})" for f in fixed)
    ratios = f"{rows / even:.2f} ({even:g}) | {of_fixed}"
    rms = 1e6 * np.sqrt(np.mean(error**2))
    return f"| {case.name} | {rows:g} | {ratios} | {rms:.1f} um | {100 * early:.1f} % | {runs} |"


def bounds() -> None:
    """Print rows below which no plan can be, by case."""
    with tempfile.TemporaryDirectory() as folder:
        for case in CASES:
            print(f"{case.name}: {Knowing.of(case, 0, Path(folder)).least():.1f}")


def main(runs: int) -> None:
    """Print the page."""
    print((__doc__ or "").strip())
    print(HEAD)
    for case in CASES:
        print(line(case, runs), flush=True)


if __name__ == "__main__":
    if sys.argv[1:] == ["least"]:
        bounds()
    else:
        main(int(sys.argv[1]) if len(sys.argv) > 1 else RUNS)
