"""Draws the pictures of the README.

docs/hangprinter.svg: what is left of each line's length before and after calibration, real data.
docs/shopfloor/: what `pkmcal diagnose --plots` draws for machines/scissors-shopfloor.csv.

`python docs/pictures.py` (needs matplotlib, in the extra `report`).
"""

from __future__ import annotations

import subprocess
from pathlib import Path

import numpy as np
from matplotlib import pyplot

from pkmcal_cli.calibration.errors_before_after import length_residuals
from pkmcal_cli.calibration.identify import identify
from pkmcal_cli.calibration.measured_problem import problem_of
from pkmcal_cli.calibration.selection import select
from pkmcal_cli.loading.load_machine import load_machine, load_measurements

ROOT = Path(__file__).resolve().parents[1]


def main() -> None:
    """Draw all."""
    hangprinter()
    command = ["pkmcal", "diagnose", "machines/scissors.yaml", "machines/scissors-shopfloor.csv", "-q"]
    subprocess.run([*command, "--plots", "docs/shopfloor"], cwd=ROOT, check=True)


def hangprinter() -> None:
    """Fit anchors, then anchors and radii, and plot the line-length residuals against the line's length."""
    loaded = load_machine(str(ROOT / "machines/hangprinter.yaml"))
    measured = load_measurements(loaded, [str(ROOT / "machines/hangprinter_2021-12-16.csv")])
    problem = problem_of(loaded.model, measured)
    stages = [("nominal", loaded.model.nominal)]
    for title, text in (("12 anchor coordinates", "auto"), ("anchors and two spool radii", "auto,R_*")):
        stages.append((title, identify(problem, select(loaded.model, text)).values))
    pyplot.rcParams["svg.hashsalt"] = "pkmcal"
    figure, axes = pyplot.subplots(1, 3, figsize=(10, 3.2), sharey=True, constrained_layout=True)
    for axis, (title, values) in zip(axes, stages, strict=True):
        residual = length_residuals(problem, values) * 1e3  # (N, 4), mm
        axis.axhline(0, color="0.7", linewidth=0.8)
        for line, name in enumerate("ABCD"):
            turns = np.degrees(measured.actuators[:, line]) / 360
            axis.plot(turns, residual[:, line], ".", label=f"line {name}")
        axis.set_title(f"{title}\nrms {np.sqrt(np.nanmean(residual**2)):.2f} mm", fontsize=10)
        axis.set_xlabel("motor turns")
    axes[0].set_ylabel("line length, measured - predicted (mm)")
    axes[0].legend(fontsize=8)
    figure.savefig(ROOT / "docs/hangprinter.svg", metadata={"Date": None})


if __name__ == "__main__":
    main()
