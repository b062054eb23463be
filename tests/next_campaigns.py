"""Rows that `plan --next` takes, by the independent simulator: `python -m tests.next_campaigns [RUNS]`.

A Triglide without redundancy, from nine even points on, until l1 is known to 20 um. Each proposal is measured by the
simulator and added to the table. Compared with an even grid, and with a fixed D-optimal plan that knows beforehand what
will happen. It would stop too early if the true error were beyond 1.96 times what is wanted in more than 5 % of runs.
Without argument 50 runs of each case, in minutes.
"""

from __future__ import annotations

import sys
import tempfile
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from pkmcal_cli.base.rotation import Array
from pkmcal_cli.calibration.observability_indices import observability
from pkmcal_cli.calibration.problem import Problem, design_problem
from pkmcal_cli.diagnosis.experiment_design import Aim, best_points, whitened_blocks, with_rows
from pkmcal_cli.diagnosis.linear import linear_problem
from pkmcal_cli.loading.load_machine import load_machine
from pkmcal_cli.prediction import Rows
from pkmcal_cli.report.console import Reporter
from pkmcal_cli.workflow.candidate_points import candidate_points
from pkmcal_cli.workflow.next_points import next_points
from tests.command import MACHINES
from tests.truth.generate import campaigns, grid

NAME, LIMIT, SIGMA, BUDGET, RUNS = "l1", 20e-6, 10e-6, 150, 50
LEAD = 5e-3  # m
MACHINE = str(MACHINES / "triglide-nonredundant.yaml")
BOX = ((200.0, 700.0), (160.0, 390.0))  # mm


@dataclass(frozen=True)
class Case:
    """What happens: noise as many times larger than stated, share of poses that cannot be measured.

    pitch: amplitude, m, of an error of both screws that the machine file does not declare, once in `LEAD`.
    """

    name: str
    noise: float = 1.0
    lost: float = 0.0
    pitch: float = 0.0

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
    Case("screws that wobble by 15 um, undeclared", pitch=15e-6),
)  # fmt: skip


@dataclass(frozen=True)
class Run:
    """Rows measured when it stopped, its status, true error of the parameter, m."""

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


def grown(case: Case, seed: int, folder: Path) -> Run:
    """One table that grows until the tool says stop."""
    machine, rng = campaigns()["triglide-nonredundant"].machine, np.random.default_rng(seed)
    true = {n: v + rng.normal(0, 0.05e-3) for n, v in machine.nominal.items() if n[0] in "lxy"}
    readings = machine.inverse(grid((*BOX[0], 3), (*BOX[1], 3)))
    values, file = measured(readings, case, seed, true, rng), folder / f"{seed}.csv"
    while True:
        file.write_text(table(readings, values), encoding="utf-8")
        found = next_points(
            machine=MACHINE, table=str(file), parameters=None, select="auto", aim=f"{NAME} {1e6 * LIMIT:g} um",
            budget=BUDGET, seed=seed, to=Reporter(True),
        )  # fmt: skip
        if found.status != "continue":
            break
        more = np.round(found.added.points.rows.readings, 9)
        readings = np.vstack([readings, more])
        values = np.vstack([values, measured(more, case, seed, true, rng)])
    return Run(found.rows, found.status, found.value - true[NAME])


def fixed(noise: float) -> tuple[int, int]:
    """Rows that an even grid needs, and a fixed D-optimal plan, at noise that is known beforehand."""
    loaded = load_machine(MACHINE)
    model, machine = loaded.model, campaigns()["triglide-nonredundant"].machine
    selected = tuple(p.name for p in model.parameters if p.identify)

    def std(problem: Problem) -> float:
        found = observability(problem, model.nominal, selected)
        return float(found.std[found.selected.index(NAME)])

    def planned(readings: Array) -> Problem:
        made = design_problem(model, Rows.at(readings))
        return replace(made, sigma=noise * made.sigma)

    even = next(
        k * m
        for k, m in ((k, m) for k in range(3, 50) for m in (k, k + 1))
        if std(planned(machine.inverse(grid((*BOX[0], k), (*BOX[1], m))))) <= LIMIT
    )
    first = planned(machine.inverse(grid((*BOX[0], 3), (*BOX[1], 3))))
    pool, _ = candidate_points(loaded, first, model.nominal, 6000, 0)
    pool = replace(pool, sigma=noise * pool.sigma)
    linear = linear_problem(with_rows(first, pool), model.nominal, selected, [], None)
    blocks = whitened_blocks(linear, len(first) + len(pool))
    chosen = best_points(linear, blocks, len(first), Aim("determine", ((NAME,),)), BUDGET, exchange=False).rows
    best = next(k for k in range(BUDGET) if std(with_rows(first, pool.take(chosen[:k]))) <= LIMIT)
    return even, len(first) + best


def main(runs: int) -> None:
    """Print the page."""
    print((__doc__ or "").strip())
    print("\n| case | rows, median | of an even grid | of a plan that knows | error beyond 1.96 x 20 um, % | runs |")
    print("|---|---|---|---|---|---|")
    for case in CASES:
        even, best = fixed(case.scatter())
        with tempfile.TemporaryDirectory() as folder:
            found = [grown(case, seed, Path(folder)) for seed in range(runs)]
        rows = np.array([r.rows for r in found])
        early = np.mean([r.status == "reached" and abs(r.error) > 1.96 * LIMIT for r in found])
        print(
            f"| {case.name} | {np.median(rows):g} | {np.median(rows) / even:.2f} | {np.median(rows) / best:.2f} | "
            f"{100 * early:.0f} | {runs} |",
            flush=True,
        )


if __name__ == "__main__":
    main(int(sys.argv[1]) if len(sys.argv) > 1 else RUNS)
