"""What `check` expects of readings in a frame of unknown place: what draws of the machine leave, in closed form."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from pkmcal_cli.base.rotation import Array
from tests.command import run

SLIDE = """
units: {length: mm, angle: deg}
space: planar
parameters:
  x0: {nominal: 0, range: 0.6}
  y0: {nominal: 0, range: 0.4}
  turn: {nominal: 0, unit: deg, range: 0.06}
  lead: {nominal: 1, range: 1.6e-4}
  sq: {nominal: 0, unit: deg, range: 0.012}
frames: {base: {at: [x0, y0], turn: turn}, head: {body: cross, turn: sq}}
guides: {long: {frame: base, along: x}, short: {frame: head, along: y}}
bodies: {cross: {guide: long, at: 0}, ram: {guide: short, at: 0, points: {tip: [0, 0]}}}
actuators: {X: {moves: cross, scale: lead}, Y: {moves: ram}}
sensors: {tracker: {at: tip, reads: [x, y, rz], sigma: {x: 5 um, y: 5 um, rz: 5 urad}, frame: fitted}}
"""
HALF = {"x0": 0.3, "y0": 0.2, "turn": np.radians(0.03), "lead": 8e-5, "sq": np.radians(0.006)}
SIGMA, PLACE, TURN = 0.005, 700.0 - 400.0j, np.radians(137.0)
X, Y = (v.ravel() for v in np.meshgrid(np.linspace(-400, 400, 5), np.linspace(-300, 300, 4)))


def readings(rng: np.random.Generator) -> tuple[Array, Array]:
    """Positions, mm, as complex numbers, and angles, rad, of a machine whose numbers are off by their ranges."""
    x0, y0, turn, lead, sq = (h * rng.normal() for h in HALF.values())
    place = x0 + 1j * y0 + np.exp(1j * turn) * (X * (1 + lead) + 1j * Y * np.exp(1j * sq))
    noise = SIGMA * (rng.normal(size=len(X)) + 1j * rng.normal(size=len(X)))
    return np.exp(1j * TURN) * place + PLACE + noise, TURN + turn + sq + 5e-6 * rng.normal(size=len(X))


def left(rng: np.random.Generator) -> Array:
    """Mean squares of x and y of the instrument, mm^2, and of rz, rad^2, when the positions place it best."""
    seen, angles = readings(rng)
    wanted = X + 1j * Y
    there, here = wanted - wanted.mean(), seen - seen.mean()
    turn = np.angle((there * here.conj()).sum())
    off = here - there * np.exp(-1j * turn)
    return np.array([(off.real**2).mean(), (off.imag**2).mean(), (np.angle(np.exp(1j * (angles + turn))) ** 2).mean()])


def test_it_is_what_the_frame_does_not_take_up(tmp_path: Path) -> None:
    """The base moves by 0.3 mm and turns by 0.03 deg; positions to each other are off by 20 to 30 um."""
    seen, angles = readings(np.random.default_rng(1))
    (tmp_path / "m.yaml").write_text(SLIDE)
    lines = [
        f"{x},{y},{z.real},{z.imag},{np.degrees(a)}\n" for x, y, z, a in zip(X, Y, seen, angles, strict=True)
    ]
    (tmp_path / "t.csv").write_text("X,Y,x,y,rz\n" + "".join(lines))
    told = run("check", tmp_path / "m.yaml", tmp_path / "t.csv", "--json").json["measurements"]["nominal"]
    expected = {c["name"]: c["expected"] for c in told}
    rng = np.random.default_rng(2)
    true = np.sqrt(np.mean([left(rng) for _ in range(4000)], axis=0))
    assert [c["unit"] for c in told[:2]] == ["mm", "mm"] and true[:2].max() < 0.04
    assert [expected["x"], expected["y"]] == pytest.approx(true[:2], rel=0.04)
    assert true[2] < np.radians(expected["rz"]) < 3 * true[2]
