"""Ten cases of self-calibration: points on four belts in the plane, on four lines in space.

`python -m tests.self_calibration_cases` writes the measured tables of docs/self-calibration.md (some minutes).
"""

from __future__ import annotations

import sys
import tempfile
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from pkmcal_cli.base.rotation import Array
from pkmcal_cli.calibration.plausible import USABLE
from tests.command import run
from tests.self_calibration_lines import MM, Case, machine_text, measured, relative_to, truth


def _frame(width: float, height: float) -> dict[str, tuple[float, ...]]:
    return {"TL": (0, height), "TR": (width, height), "BL": (0, 0), "BR": (width, 0)}


LOW = {"BL": 60.0, "BR": 60.0}
G = 9.81
SEEDS = 20

PLANAR = (
    Case(
        name="router",
        what="frame 2.6 m x 1.9 m, 15 deg off the vertical, stops known to 5 mm, 12 distances",
        anchors=_frame(2600, 1900),
        low=(400, 400),
        high=(2200, 1500),
        counts=(8, 5),
        forced=LOW,
        zero=(250, 5),
        weight=(0, -9.4757),
        mass=8,
        spans=12,
        datum=("BLx", "BLy"),
        seed=11,
    ),
    Case(
        name="table",
        what="horizontal frame 1.2 m x 0.9 m, homed at a known position, encoders only",
        anchors=_frame(1200, 900),
        low=(300, 250),
        high=(900, 750),
        counts=(7, 6),
        forced={"BL": 40.0, "BR": 40.0},
        wide=15,
        EA=8e4,
        sigma=0.1,
        datum=("BRy",),
        seed=12,
    ),
    Case(
        name="plotter",
        what="wall 4 m x 2.5 m, stops known to 20 mm, pose measured in 5 of 48 rows",
        anchors=_frame(4000, 2500),
        low=(700, 500),
        high=(3300, 1900),
        counts=(8, 6),
        forced={"BL": 90.0, "BR": 90.0},
        wide=40,
        zero=(400, 20),
        weight=(0, -G),
        mass=5,
        sigma=0.5,
        known=5,
        seed=13,
    ),
    Case(
        name="trapezoid",
        what="irregular horizontal frame, stiff belts, paid-out lengths known, 8 distances, one bench-measured side",
        anchors={"TL": (200, 1500), "TR": (1600, 1700), "BL": (0, 0), "BR": (2000, -150)},
        low=(600, 550),
        high=(1300, 1150),
        counts=(7, 6),
        forced={"BL": 50.0, "BR": 50.0},
        wide=30,
        zero=(100, 0),
        EA=1e8,
        sigma=0.2,
        spans=8,
        benches=(("BL", "BR"),),
        datum=("BLx", "BLy", "BRy"),
        seed=14,
    ),
    Case(
        name="tower",
        what="horizontal frame 1.1 m x 3 m, right belts in force control, drums known to 0.5 mm, 12 distances",
        anchors=_frame(1100, 3000),
        low=(400, 600),
        high=(850, 2300),
        counts=(5, 9),
        forced={"TR": 120.0, "BR": 120.0},
        zero=(150, 5),
        radius=20,
        free_radius=0.5,
        spans=12,
        datum=("BLx", "BLy", "BRy"),
        seed=15,
    ),
)
HANG = {"A": (0, -1500, -100), "B": (1250, 1150, -140), "C": (-1300, 800, -120), "D": (50, -30, 2300)}
TURNED = ("Ax", "Az", "Bz")
SPATIAL = (
    Case(
        name="printer",
        what="three lines below, one from the ceiling, homed, encoders only",
        anchors=HANG,
        low=(-400, -400, 0),
        high=(400, 400, 1200),
        counts=(4, 4, 4),
        forced={"D": 30.0},
        wide=50,
        taper=(1, 0.4),
        home=(0, 0, 0),
        datum=TURNED,
        sigma=0.2,
        seed=21,
    ),
    Case(
        name="camera",
        what="same type, larger, pose measured in 6 of 48 rows",
        anchors={"A": (0, -2100, -150), "B": (1900, 1200, -100), "C": (-1800, 1300, -200), "D": (0, 0, 2900)},
        low=(-600, -600, 0),
        high=(600, 600, 1500),
        counts=(4, 4, 3),
        forced={"D": 40.0},
        wide=60,
        taper=(1, 0.4),
        home=(0, 0, 0),
        sigma=0.5,
        known=6,
        seed=22,
    ),
    Case(
        name="drums",
        what="drums known to 1 mm, 12 distances between marks",
        anchors={"A": (100, -1700, -80), "B": (1500, 900, -180), "C": (-1350, 950, -60), "D": (-40, 60, 2500)},
        low=(-450, -450, 0),
        high=(450, 450, 1200),
        counts=(4, 4, 3),
        forced={"D": 30.0},
        wide=40,
        taper=(1, 0.4),
        home=(0, 0, 0),
        radius=75,
        free_radius=1,
        spans=12,
        datum=TURNED,
        seed=23,
    ),
    Case(
        name="heavy",
        what="tool of 2 kg on soft lines, line A in force control, two bench-measured anchor distances",
        anchors=HANG,
        low=(-350, -350, 100),
        high=(350, 350, 1100),
        counts=(4, 4, 4),
        forced={"A": 35.0},
        wide=30,
        taper=(1, 0.4),
        home=(0, 0, 100),
        EA=3e4,
        weight=(0, 0, -G),
        mass=2,
        benches=(("A", "B"), ("B", "C")),
        datum=TURNED,
        sigma=0.3,
        seed=24,
    ),
    Case(
        name="ceiling",
        what="three lines from the ceiling, one to the floor, stiff, paid-out lengths known, pose in 4 of 64 rows",
        anchors={"A": (0, -1400, 2200), "B": (1300, 800, 2300), "C": (-1250, 850, 2250), "D": (30, 20, -300)},
        low=(-300, -300, 700),
        high=(300, 300, 1400),
        counts=(4, 4, 4),
        forced={"D": 60.0},
        wide=40,
        taper=(0.5, 0.8),
        zero=(200, 0),
        EA=2e7,
        weight=(0, 0, -G),
        mass=1,
        known=4,
        sigma=0.3,
        seed=25,
    ),
)
CASES = {c.name: c for c in (*PLANAR, *SPATIAL)}


@dataclass(frozen=True)
class Calibrated:
    """A calibration: seed of the truth and the noise, status, chi-square per degree of freedom, and of each parameter
    that was not held as datum value and standard uncertainty in mm, nan where it is not determined; what was held."""

    seed: int
    status: str
    chi2_per_dof: float
    found: dict[str, tuple[float, float]]
    said: str
    datum: tuple[str, ...]

    def anchors(self, case: Case) -> list[str]:
        """Coordinates of anchors that were identified."""
        return [n for n in self.found if n[:-1] in case.lines]

    def scores(self, case: Case) -> Array:
        """Errors of the anchors' coordinates, relative to the datum, in standard uncertainties."""
        true = relative_to(case, truth(case, self.seed), self.datum)
        return np.array([(v - true[n] / MM) / s for n, (v, s) in self.found.items() if n in self.anchors(case)])


def calibrated(case: Case, seed: int, forced: Mapping[str, float] | None = None) -> Calibrated:
    """A case by the command, from files; `forced`: the lines that the machine file takes as force-controlled."""
    data = measured(case, seed)
    with tempfile.TemporaryDirectory() as folder:
        machine, table = Path(folder) / "machine.yaml", Path(folder) / "table.csv"
        machine.write_text(machine_text(case, data.bench, forced), encoding="utf-8")
        table.write_text(data.table, encoding="utf-8")
        done = run("calibrate", machine, table, "--json", "--holdout", "none")
    if not done.out:
        raise RuntimeError(f"{case.name}: {done.err}")
    result: dict[str, Any] = done.json
    datum = tuple(result["datum"] or ())
    rows = {p["name"]: p for p in result["parameters"] if p["name"] not in datum}
    found = {n: (p["value"], np.nan if p["std"] is None else p["std"]) for n, p in rows.items()}
    return Calibrated(seed, result["status"], result["chi2_per_dof"], found, done.err, datum)


OTHERS: dict[str, tuple[dict[str, float], ...]] = {
    "trapezoid": ({"TL": 50.0, "TR": 50.0}, {"TL": 50.0, "BL": 50.0}, {"TR": 50.0, "BR": 50.0}),
    "ceiling": ({"A": 60.0}, {"B": 60.0}),
}
"""Other lines that may be taken as force-controlled. A pull stretches these stiff lines by 0.1 % of sigma."""


MIRRORED = ("ceiling", {"C": 60.0})
"""From the drawing this one may end at a mirror image; further starts, half a minute, find the right one."""


def disagreement(name: str, seed: int, forced: Mapping[str, float]) -> float:
    """Largest difference of an anchor's coordinate between two choices of inputs, in its standard uncertainty."""
    case = CASES[name]
    here, there = calibrated(case, seed), calibrated(case, seed, forced)
    return max(abs(there.found[n][0] - v) / s for n, (v, s) in here.found.items() if n in here.anchors(case))


@dataclass(frozen=True)
class Summary:
    """Of a case: calibrations that converged, scores and standard uncertainties (mm) of anchors, chi-square per dof."""

    converged: int
    scores: Array
    chi2_per_dof: Array
    std: Array

    @property
    def inside(self) -> int:
        """Coordinates within three standard uncertainties; one that is not determined is not."""
        return int((np.abs(self.scores) <= 3).sum())


def summary(case: Case, seeds: range) -> Summary:
    """A case with several truths and noises."""
    every = [calibrated(case, seed) for seed in seeds]
    scores = np.concatenate([c.scores(case) for c in every])
    std = np.array([s for c in every for n, (_, s) in c.found.items() if n in c.anchors(case)])
    done = sum(c.status in USABLE for c in every)
    return Summary(done, scores, np.array([c.chi2_per_dof for c in every]), std)


if __name__ == "__main__":
    from tests.self_calibration_page import write

    write(range(int(sys.argv[1]) if len(sys.argv) > 1 else SEEDS))
