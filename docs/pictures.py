"""Draws the pictures of the pages.

docs/shopfloor/: what `pkmcal diagnose --plots` draws for machines/scissors-shopfloor.csv.
docs/triglide-strained.svg, docs/gantry-strained.svg: what `pkmcal draw` draws of strained machines.
docs/hangprinter.svg: what is left of each line's length before and after calibration, real data.

`python -m docs.pictures` (from the repository's folder). `python -m docs.axes` draws docs/axes.svg, and
`pkmcal study` docs/figure12.svg (see docs/study.md).
"""

from __future__ import annotations

import shlex
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from pkmcal_cli.base.rotation import Array
from pkmcal_cli.calibration.errors_before_after import length_residuals
from pkmcal_cli.calibration.identify import identify
from pkmcal_cli.calibration.measured_problem import problem_of
from pkmcal_cli.calibration.selection import select
from pkmcal_cli.loading.load_machine import load_machine, load_measurements
from pkmcal_cli.pictures.picture import AFTER, BEFORE, NOISE, OTHER, Picture, write_picture

if TYPE_CHECKING:
    from matplotlib.figure import Figure

ROOT = Path(__file__).resolve().parents[1]
_LOOKS = ((AFTER, "o"), (BEFORE, "s"), (OTHER, "^"), ("#CC79A7", "v"))
_LONG_ROD = "parameters: {l3: {value: 600.1, unit: mm}}\n"
DRAWN = (
    "draw machines/triglide.yaml --grid x=300:500:3,y=250:250:1 --row 2 -p {long_rod} --forces --scale 200 "
    "-o docs/triglide-strained.svg",
    "draw machines/gantry.yaml --grid x=750:750:1,y=900:900:1 --scale 5000 -o docs/gantry-strained.svg",
    "diagnose machines/scissors.yaml machines/scissors-shopfloor.csv --fail-on none --plots docs/shopfloor",
)
"""Commands that draw pictures of pages; `long_rod`: parameters of a Triglide whose third rod is too long."""


def main() -> None:
    """Draw all."""
    hangprinter()
    with tempfile.TemporaryDirectory() as folder:
        long_rod = Path(folder) / "long-rod.yaml"
        long_rod.write_text(_LONG_ROD, encoding="utf-8")
        for line in DRAWN:
            words = shlex.split(line.format(long_rod=long_rod))
            force = ["--force"] if words[0] == "draw" else []
            subprocess.run([sys.executable, "-m", "pkmcal_cli", *words, *force, "-q"], cwd=ROOT, check=True)


def hangprinter() -> None:
    """Fit anchors, then anchors and radii, and plot the line-length residuals against the line's length."""
    loaded = load_machine(str(ROOT / "machines/hangprinter.yaml"))
    measured = load_measurements(loaded, [str(ROOT / "machines/hangprinter_2021-12-16.csv")])
    problem = problem_of(loaded.model, measured)
    stages = [("nominal", loaded.model.nominal)]
    for title, text in (("12 anchor coordinates", "auto"), ("anchors and two spool radii", "auto,R_*")):
        stages.append((title, identify(problem, select(loaded.model, text)).values))
    turns = np.degrees(measured.actuators) / 360
    residuals = [(title, length_residuals(problem, values) * 1e3) for title, values in stages]  # (N, 4), mm

    source = "hangprinter.yaml, hangprinter_2021-12-16.csv"

    def draw(figure: Figure) -> None:
        figure.suptitle(source, fontsize=10, weight="bold")
        axes = figure.subplots(1, 3, sharey=True)
        for axis, (title, residual) in zip(axes, residuals, strict=True):
            _panel(axis, turns, residual)
            axis.set_title(f"{title}\nrms {np.sqrt(np.nanmean(residual**2)):.2f} mm", fontsize=10)
        axes[0].set_ylabel("line length, measured - predicted [mm]")
        axes[0].legend(fontsize=8)

    picture = Picture("hangprinter", source, "Line lengths, measured minus predicted.", (10.0, 3.5), draw)
    write_picture(picture, str(ROOT / "docs/hangprinter.svg"), (), force=True)


def _panel(axis, turns: Array, residual: Array) -> None:  # type: ignore[no-untyped-def]
    axis.axhline(0, color=NOISE, linewidth=0.8)
    for line, (name, (colour, marker)) in enumerate(zip("ABCD", _LOOKS, strict=True)):
        axis.plot(turns[:, line], residual[:, line], marker, ms=4, color=colour, mec="none", label=f"line {name}")
    axis.set_xlabel("motor turns")


if __name__ == "__main__":
    main()
