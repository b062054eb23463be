"""`compare` of changes that the tables hardly see: a point on three rods of one stiffness, by its few lines."""

from __future__ import annotations

from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from pkmcal_cli.base.rotation import Array
from pkmcal_cli.report import comparison
from pkmcal_cli.report.comparison import Compared
from tests.command import run

MACHINE = """\
units: {length: mm, angle: deg, force: N}
space: planar
ranges: {length: 0.2}
parameters:
  "l{i}": {each: {i: [1, 2, 3]}, nominal: 600}
  "z{i}": {each: {i: [1, 2, 3]}, nominal: 0}
  "h{i}": {each: {i: [1, 2, 3], v: [0, 0, 900]}, nominal: "{v}"}
  k: {nominal: 20 kN/mm, range: 5 kN/mm, identify: false}
guides: {"rail{i}": {each: {i: [1, 2, 3]}, at: [0, "h{i}"], along: x}}
bodies: {"c{i}": {each: {i: [1, 2, 3], a: [103, 897, 103]}, guide: "rail{i}", at: "{a}", points: {"C{i}": [0, 0]}}}
nodes: {tcp: [500, 450]}
bars: {"rod{i}": {each: {i: [1, 2, 3]}, between: ["C{i}", tcp], length: "l{i}", k: k}}
actuators:
  "q{i}": {each: {i: [1, 2]}, moves: "c{i}", zero: "z{i}", limits: [-400, 1400]}
  q3: {moves: c3, zero: z3, redundant: true, limits: [-400, 1400]}
sensors: {tracker: {at: tcp, reads: [x, y], sigma: 5 um, frame: machine}}
workspace: {box: {x: [200, 800], y: [350, 550]}}
"""
NAMES = ("l1", "l2", "l3", "z1", "z2", "z3", "h1", "h2", "h3")
NOMINAL, HALF = np.array([600.0, 600.0, 600.0, 0.0, 0.0, 0.0, 0.0, 0.0, 900.0]), 0.1
SIDES = np.array([-1.0, 1.0, -1.0])
LOW, HIGH = [350.0, 430.0], [450.0, 470.0]
"""Where is measured: a small part of the workspace."""


def readings(places: Array, values: Array) -> Array:
    """Of the drives (n, 3) with the rods' ends there (n, 2)."""
    l, z, h = values.reshape(3, 3)
    return np.asarray(places[:, :1] + SIDES * np.sqrt(l**2 - (places[:, 1:] - h) ** 2) - z)


def point(drives: Array, values: Array, guess: Array) -> Array:
    """Where (n, 2) the rods are strained least."""
    l, z, h = values.reshape(3, 3)
    carriages, places = np.stack([drives + z, np.tile(h, (len(drives), 1))], axis=2), guess.copy()
    for _ in range(12):
        along = places[:, None] - carriages
        size = np.hypot(along[..., 0], along[..., 1])
        by_place = along / size[..., None]
        normal = np.einsum("nki,nkj->nij", by_place, by_place)
        off = np.einsum("nki,nk->ni", by_place, l - size)
        places = places + np.linalg.solve(normal, off[..., None])[..., 0]
    return np.asarray(places)


def hardly_seen(places: Array, pair: tuple[str, str]) -> Array:
    """The change (9,) of two parameters, 4 half ranges together, that moves the measured points least."""
    drives, columns = readings(places, NOMINAL), [NAMES.index(name) for name in pair]
    moves = [
        (point(drives, NOMINAL + d, places) - point(drives, NOMINAL - d, places)).ravel()
        for d in 1e-3 * np.eye(len(NOMINAL))[columns]
    ]
    change = np.zeros(len(NOMINAL))
    change[columns] = 4 * HALF * np.linalg.svd(np.stack(moves, axis=1), full_matrices=False)[2][-1]
    return change


@pytest.mark.parametrize("pair", [("l3", "h3"), ("l2", "z2"), ("l3", "z3")], ids="-".join)
def test_changes_that_no_table_sees_are_in_the_uncertainty(pair: tuple[str, str], tmp_path: Path) -> None:
    """Away from where was measured, the tool point is 30 to 50 um off by a change that is 2 to 10 um there. As several
    single parameters explain those, none stands for all: it said 1 to 3 um, u 2 um, by one of them alone."""
    rng = np.random.default_rng(list(map(ord, "".join(pair))))
    true, files = NOMINAL + HALF * rng.normal(size=len(NOMINAL)), []
    change, machine = hardly_seen(rng.uniform(LOW, HIGH, (60, 2)), pair), tmp_path / "m.yaml"
    machine.write_text(MACHINE, encoding="utf-8")
    for k in range(2):
        places = rng.uniform(LOW, HIGH, (30, 2))
        drives = np.round(readings(places, NOMINAL), 4)
        seen = point(drives, true + k * change, places) + 5e-3 * rng.normal(size=places.shape)
        table, file = tmp_path / f"t{k}.csv", tmp_path / f"p{k}.yaml"
        np.savetxt(table, np.hstack([drives, seen]), "%.6f", ",", header="q1,q2,q3,x,y", comments="")
        assert run("calibrate", machine, table, "--holdout", "none", "-o", file, "-q").code == 0
        files.append(file)
    done = run("compare", *files, "--machine", machine, "--json")
    tool = done.json["tool_point"]
    place = np.array([[tool["at"]["x"], tool["at"]["y"]]])
    drives = readings(place, true)
    moved = 1e3 * np.linalg.norm(point(drives, true + change, place) - point(drives, true, place))
    assert moved > 25 and tool["alone"] is None
    assert abs(tool["max"] - moved) < 2 * tool["std"] < moved + 25
    assert "u contains changes of half a range that no data see" in done.err


@pytest.mark.parametrize(("rivals", "told"), [(0, "of one"), (2, "of all")])
def test_one_parameter_stands_for_a_change_only_without_rivals(
    rivals: int, told: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(comparison, "likely_changes", lambda *_: "of all")
    explaining = (SimpleNamespace(explains=True, estimate="of one"),) * (1 + rivals)
    compared = SimpleNamespace(
        test=SimpleNamespace(p_value=1e-6), alone=SimpleNamespace(equals=lambda _: explaining), named=lambda _: (),
        common=None, free=(), course=SimpleNamespace(times=(0.0, 1.0)),
    )  # fmt: skip
    assert Compared.likely(compared, 0.01) == told  # type: ignore[arg-type]


ALIKE = """\
units: {length: mm, angle: deg, force: N}
space: planar
ranges: {length: 1}
parameters: {a: 30, b: 20}
guides: {rail: {along: x}}
bodies: {c: {guide: rail, at: 0, points: {tip: [a + b, b/1000]}}}
actuators: {q: {moves: c}}
sensors: {tracker: {at: tip, reads: [x, y], sigma: 5 um, frame: machine}}
"""


def test_changes_that_not_all_determine_are_drawn_as_the_table_tells_them(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Two offsets in a row act nearly alike, so neither is determined: of 0.1 mm between two tables each takes half."""
    monkeypatch.chdir(tmp_path)
    Path("m.yaml").write_text(ALIKE, encoding="utf-8")
    for name, shift in (("a", 0.0), ("b", 0.1)):
        x, y = ([0.004 * (-1) ** (q // k) for q in range(10)] for k in (1, 2))
        rows = [f"{q},{q + 50 + shift + x[q]:.4f},{0.02 + y[q]:.4f}" for q in range(10)]
        Path(f"{name}.csv").write_text("q,x,y\n" + "\n".join(rows) + "\n", encoding="utf-8")
        assert run("calibrate", "m.yaml", f"{name}.csv", "-o", f"{name}.yaml", "--holdout", "none").code == 0
    done = run("compare", "a.yaml", "b.yaml", "--plot", "c.svg")
    assert done.code == 1 and "\na     30.0" in done.err and "\nb     20.0" in done.err
    drawn = Path("c.svg").read_text(encoding="utf-8")
    assert "dot-0" in drawn and "dot-1" in drawn and drawn.count(" mm *") == 2
