"""Figure 12 of Ecorchard 2010: `python -m tests.figure12` writes docs/figure12.csv and docs/figure12.svg (minutes).

Errors after calibration against the number of measured points, redundant and non-redundant Triglide. Both machines
have the same errors in the parameters that they share, and are measured at the same points with the same noise.
"""

from __future__ import annotations

import csv
import os
import sys
from collections.abc import Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import astuple, dataclass, fields
from functools import partial
from pathlib import Path

import numpy as np

from pkmcal_cli.base.rotation import Array
from pkmcal_cli.calibration.identify import identify
from pkmcal_cli.prediction import Rows, predict
from pkmcal_cli.prediction.inverse_kinematics import drive_positions
from tests.campaigns import by_engine, shipped
from tests.support import UM

MACHINES = ("triglide", "triglide-nonredundant")
POINTS = (5, 7, 10, 14, 20, 28, 40, 57, 80, 113, 160, 226)
REPETITIONS = 200
VALIDATION = 10
DOCS = Path(__file__).resolve().parents[1] / "docs"


@dataclass(frozen=True)
class Errors:
    """Means over repetitions, um: of all identified parameters, of the six that both machines have, of the TCP at ten
    other points; and the standard deviation of the mean of the last."""

    machine: str
    points: int
    parameters: float
    common: float
    tcp: float
    tcp_scatter: float


def points(rng: np.random.Generator, count: int) -> Array:
    """Random points (n, 6) of the workspace."""
    place = np.zeros((count, 6))
    place[:, :2] = rng.uniform([0, 0.16], [0.95, 0.39], (count, 2))
    return place


def once(name: str, count: int, seed: int) -> tuple[float, float, float]:
    """One repetition: mean errors of parameters, of common ones and of the TCP, m."""
    plan, rng = shipped(name), np.random.default_rng([12, count, seed])
    q = drive_positions(plan.model, points(rng, count + VALIDATION)).readings
    drawn = dict(zip(shipped(MACHINES[0]).selected, rng.normal(size=9), strict=True))
    values = plan.model.nominal
    values[plan.index] += np.array([drawn[n] for n in plan.selected]) * plan.ranges / 2
    true = predict(plan.model, values, Rows.at(q)).values
    noise = rng.normal(size=(count, 2)) * plan.sigma
    problem = by_engine(plan).problem(true[:count] + noise, q[:count])
    fit = identify(problem, plan.selected)
    assert fit.status == "converged"
    found = predict(plan.model, fit.values, Rows.at(q[count:])).values
    error = np.abs(fit.values - values)[plan.index]
    shared = [n in shipped(MACHINES[1]).selected for n in plan.selected]
    off = np.hypot(*(found - true[count:]).T)
    return float(error.mean()), float(error[shared].mean()), float(off.mean())


def errors(name: str, count: int, repetitions: int) -> Errors:
    """Means over repetitions with seeds 0, 1, ..."""
    found = np.array([once(name, count, seed) for seed in range(repetitions)]) / UM
    scatter = found[:, 2].std() / np.sqrt(repetitions)
    return Errors(name, count, *(float(v) for v in found.mean(axis=0)), float(scatter))


def curves(counts: Sequence[int], repetitions: int, jobs: int = 1) -> list[Errors]:
    """Of both machines, by number of points."""
    cases = [(name, count) for name in MACHINES for count in counts]
    with ProcessPoolExecutor(jobs) as pool:
        return list(pool.map(partial(_case, repetitions), cases))


def _case(repetitions: int, case: tuple[str, int]) -> Errors:
    return errors(*case, repetitions)


def write(found: Sequence[Errors], file: Path) -> None:
    """The table."""
    with file.open("w", newline="", encoding="utf-8") as out:
        writer = csv.writer(out, lineterminator="\n")
        writer.writerow(f.name if f.name in ("machine", "points") else f"{f.name} [um]" for f in fields(Errors))
        for row in found:
            writer.writerow([v if isinstance(v, str | int) else f"{v:.3f}" for v in astuple(row)])


def draw(found: Sequence[Errors], file: Path) -> None:
    """The two curves of either machine."""
    import matplotlib as mpl

    mpl.use("svg")
    mpl.rcParams |= {"svg.hashsalt": "figure12", "font.size": 9}
    import matplotlib.pyplot as plt

    figure, axes = plt.subplots(1, 2, figsize=(8, 3.2), layout="constrained")
    for name, style in zip(MACHINES, ("s-", "o--"), strict=True):
        rows = [e for e in found if e.machine == name]
        count = [e.points for e in rows]
        axes[0].loglog(count, [e.parameters for e in rows], style, label=name, ms=4)
        axes[1].loglog(count, [e.tcp for e in rows], style, label=name, ms=4)
    for axis, title in zip(axes, ("mean error of the parameters, µm", "mean error of the TCP, µm"), strict=True):
        axis.set(title=title, xlabel="measured points, noise 10 µm")
        axis.grid(alpha=0.3, which="both")
        axis.legend()
    figure.savefig(file, metadata={"Date": None})
    plt.close(figure)


if __name__ == "__main__":
    every = curves(POINTS, int(sys.argv[1]) if len(sys.argv) > 1 else REPETITIONS, os.cpu_count() or 1)
    write(every, DOCS / "figure12.csv")
    draw(every, DOCS / "figure12.svg")
