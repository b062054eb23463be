"""Uncertainties of corrected positions to each other, against draws of the parameters in closed form."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from pkmcal_cli.base.rotation import Array
from tests.command import run
from tests.cross_slide import cross_slide

STAGE = cross_slide("machine")
STD = {"x0": 0.3, "y0": 0.2, "turn": 0.05, "lead": 2e-5, "sq": 5e-4}
"""A cross slide; the base is hardly known (mm, deg), the lead of X (1) and the squareness (deg) are."""
CORRELATION = -0.6  # of x0 and the lead
X, Y = (v.ravel() for v in np.meshgrid(np.linspace(-400, 400, 4), np.linspace(-300, 300, 3)))


def parameter_file(folder: Path) -> Path:
    names, matrix = list(STD), np.eye(len(STD))
    matrix[0, 3] = matrix[3, 0] = CORRELATION
    units = {"x0": "mm", "y0": "mm", "turn": "deg", "lead": "1", "sq": "deg"}
    values = {n: {"value": float(n == "lead"), "std": s, "unit": units[n]} for n, s in STD.items()}
    lines = [f"  {n}: {{value: {v['value']}, std: {v['std']}, unit: '{v['unit']}'}}" for n, v in values.items()]
    text = "\n".join(["parameters:", *lines, "correlations:", f"  names: [{', '.join(names)}]"])
    file = folder / "p.yaml"
    file.write_text(f"{text}\n  std: {list(STD.values())}\n  matrix: {matrix.tolist()}\n")
    return file


def drawn(count: int) -> tuple[Array, Array]:
    """Rms of what draws do to the places, mm, and of what is left when the nearest rigid motion is taken off."""
    rng = np.random.default_rng(3)
    x0, y0, turn, lead, sq = (s * d for s, d in zip(STD.values(), rng.normal(size=(5, count)), strict=True))
    lead = STD["lead"] * (CORRELATION * x0 / STD["x0"] + np.sqrt(1 - CORRELATION**2) * lead / STD["lead"])
    ram = 1j * Y * np.exp(1j * np.radians(sq))[:, None]
    places = (x0 + 1j * y0)[:, None] + np.exp(1j * np.radians(turn))[:, None] * (X * (1 + lead)[:, None] + ram)
    wanted = X + 1j * Y
    here, there = places - places.mean(axis=1, keepdims=True), wanted - wanted.mean()
    back = np.exp(-1j * np.angle((here * there.conj()).sum(axis=1)))[:, None]
    return tuple(np.sqrt((np.abs(e) ** 2).mean()) for e in (places - wanted, here * back - there))  # type: ignore[return-value]


def test_positions_to_each_other_are_surer_than_the_base(tmp_path: Path) -> None:
    (tmp_path / "m.yaml").write_text(STAGE)
    (tmp_path / "t.csv").write_text("x,y\n" + "".join(f"{x},{y}\n" for x, y in zip(X, Y, strict=True)))
    parameters = parameter_file(tmp_path)
    asked = ("correct", tmp_path / "m.yaml", tmp_path / "t.csv", "-p", parameters, "-o", tmp_path / "c.csv", "--force")
    errors = run(*asked, "--json").json["errors"]["position"]
    whole, apart = drawn(20_000)
    assert errors["u"]["rms"] == pytest.approx(1e3 * whole, rel=0.02)
    assert errors["u_apart"]["rms"] == pytest.approx(1e3 * apart, rel=0.02)
    assert f"u of positions to each other: {1e3 * apart:.2g}"[:-1] in run(*asked).err


def test_too_few_positions_show_nothing_of_each_other(tmp_path: Path) -> None:
    (tmp_path / "m.yaml").write_text(STAGE)
    (tmp_path / "t.csv").write_text("x,y\n-400,0\n300,20\n")
    parameters, to = parameter_file(tmp_path), tmp_path / "c.csv"
    done = run("correct", tmp_path / "m.yaml", tmp_path / "t.csv", "-p", parameters, "-o", to, "--json")
    assert done.json["errors"]["position"]["u_apart"] == {"rms": None, "max": None}
