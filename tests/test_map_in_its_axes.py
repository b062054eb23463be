"""Uncertainties of positions that an instrument reads which may stand anywhere, against draws in closed form."""

from __future__ import annotations

import csv
from pathlib import Path

import numpy as np
import pytest

from pkmcal_cli.base.rotation import Array
from tests.command import run
from tests.cross_slide import cross_slide

SLIDE = cross_slide("fitted")
BAR = "  bar: {kind: distance, at: tip, to: O, sigma: 5 um}\nground: {O: [0, 0]}\n"
STD = {"x0": 0.3, "y0": 0.2, "turn": 0.05, "lead": 2e-5, "sq": 5e-4}
OWN = {"frame@tracker.tx": 0.003, "frame@tracker.ty": 0.002, "frame@tracker.rz": 3e-4}
"""Of what the readings do not show (mm, deg), of the rest, and of the frame for a given place of the base."""
PLACE = {"tx": 700.0, "ty": -400.0, "rz": 137.0}
X, Y = (v.ravel() for v in np.meshgrid(np.linspace(-400, 400, 4), np.linspace(-300, 300, 3)))


def mixing() -> Array:
    """How names (5 + 3) follow from independent numbers: the frame moves with the base, and the readings stay."""
    turn, out = np.radians(PLACE["rz"]), np.diag([*STD.values(), *OWN.values()])
    out[5:7, 0] = -STD["x0"] * np.array([np.cos(turn), np.sin(turn)])
    out[5:7, 1] = -STD["y0"] * np.array([-np.sin(turn), np.cos(turn)])
    out[7, 2] = -STD["turn"]
    return out


def parameter_file(folder: Path) -> Path:
    names, factor = [*STD, *OWN], mixing()
    covariance = factor @ factor.T
    std = np.sqrt(np.diag(covariance))
    units = dict(zip(names, ["mm", "mm", "deg", "1", "deg", "mm", "mm", "deg"], strict=True))
    values = {"lead": 1.0} | {f"frame@tracker.{n}": v for n, v in PLACE.items()}
    lines = [
        f'  "{n}": {{value: {values.get(n, 0.0)}, std: {s!r}, unit: "{units[n]}"}}'
        for n, s in zip(names, std.tolist(), strict=True)
    ]
    matrix = (covariance / np.outer(std, std)).tolist()
    quoted = ", ".join(f'"{n}"' for n in names)
    text = "\n".join(["parameters:", *lines, "correlations:", f"  names: [{quoted}]"])
    file = folder / "p.yaml"
    file.write_text(f"{text}\n  std: {std.tolist()}\n  matrix: {matrix}\n")
    return file


def drawn(count: int) -> tuple[Array, Array]:
    """Standard deviations (12, 2) of readings and of places in the axes of the base, um, by draws of all numbers."""
    x0, y0, turn, lead, sq, *frame = mixing() @ np.random.default_rng(3).normal(size=(8, count))
    ram = 1j * Y * np.exp(1j * np.radians(sq))[:, None]
    place = (x0 + 1j * y0)[:, None] + np.exp(1j * np.radians(turn))[:, None] * (X * (1 + lead)[:, None] + ram)
    tx, ty, rz = (PLACE[n] + by for n, by in zip(PLACE, frame, strict=True))
    reading = np.exp(1j * np.radians(rz))[:, None] * place + (tx + 1j * ty)[:, None]
    return tuple(np.stack([v.real.std(axis=0), v.imag.std(axis=0)], axis=1) * 1e3 for v in (reading, place))  # type: ignore[return-value]


@pytest.mark.parametrize(("more", "named"), [("", ""), (BAR, "tracker.")])
def test_they_are_those_of_the_readings(tmp_path: Path, more: str, named: str) -> None:
    """The base is known to 0.3 mm, and the readings to some micrometres: they stand beside their own uncertainty."""
    (tmp_path / "m.yaml").write_text(SLIDE + more)
    (tmp_path / "t.csv").write_text("X,Y\n" + "".join(f"{x},{y}\n" for x, y in zip(X, Y, strict=True)))
    asked = ("simulate", tmp_path / "m.yaml", tmp_path / "t.csv", "-p", parameter_file(tmp_path), "--uncertainty")
    done = run(*asked, "-o", tmp_path / "map.csv", "--json")
    reading, place = drawn(20_000)
    assert reading.max() < 8.0 and place.min() > 190.0
    rows = [r for r in csv.reader((tmp_path / "map.csv").read_text().splitlines()) if not r[0].startswith("#")]
    columns = [rows[0].index(f"u.{named}{c} [um]") for c in "xy"]
    told = np.array([[float(row[k]) for k in columns] for row in rows[1:]])
    assert told == pytest.approx(reading, rel=0.03)
    assert done.json["uncertainty"]["rms"] == pytest.approx(np.sqrt((reading**2).sum(axis=1).mean()), rel=0.03)
    assert "in the axes of tracker: " in done.err


def test_an_aligned_instrument_reads_in_the_axes_of_the_base(tmp_path: Path) -> None:
    """A grid plate beside the tracker shows where the base lies: these are the coordinates."""
    grid = "  grid: {at: tip, reads: [x, y], sigma: 5 um, frame: machine}\n"
    (tmp_path / "m.yaml").write_text(SLIDE + grid)
    (tmp_path / "t.csv").write_text("X,Y\n" + "".join(f"{x},{y}\n" for x, y in zip(X, Y, strict=True)))
    asked = ("simulate", tmp_path / "m.yaml", tmp_path / "t.csv", "-p", parameter_file(tmp_path), "--uncertainty")
    done = run(*asked, "-o", tmp_path / "map.csv", "--json")
    place = drawn(20_000)[1]
    assert done.json["uncertainty"]["rms"] == pytest.approx(np.sqrt((place**2).sum(axis=1).mean()), rel=0.03)
