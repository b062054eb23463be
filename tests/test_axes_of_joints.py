"""Axes that depend on parameters: universal, cylindrical and planar joints, and the axis of an angle sensor."""

from __future__ import annotations

from pathlib import Path

import cloudpickle
import numpy as np
import pytest
from scipy.optimize import brentq

from pkmcal_cli.prediction import Request
from tests.command import ROOT, column, run
from tests.measured import jacobian_check
from tests.pages import machine_files as written_files
from tests.support import at, compiled, model
from tests.test_axes import HEAD, NOMINAL, arm, product_of_exponentials, turned

LANGUAGE = ROOT / "docs" / "machine-language.md"

HOOKE = """
units: {length: mm, angle: deg, force: N}
ranges: {angle: 1, scale: 0.01}
space: spatial
parameters: {b: 35, c: 0.1, d: -0.05}
ground: {A: [-100, 0, 0], U: [U], V: [V]}
bodies:
  input: {at: [-100, 0, 0], points: {I: [100, 0, 0]}}
  output: {at: [0, 0, 0], points: {O: [0, 0, 0], E: [E]}}
joints:
  first: {between: [A, input], type: revolute, axis: x}
  cross: {between: [I, O], type: universal, axes: [[c, 0, 1], [-sin(b), cos(b), d]]}
bars: {u: {between: [U, E]}, v: {between: [V, E]}}
actuators: {q: {turns: first}}
sensors: {s: {kind: tcp, at: output, reads: [rx, ry, rz], sigma: 1 urad, frame: machine}}
"""
SHAFT = np.array([np.cos(np.radians(35)), np.sin(np.radians(35)), 0.0])
"""The output shaft, held by two bars."""


def hooke(values: dict[str, complex], angle: float, out: complex) -> complex:
    """Change of the cosine between the axes of the cross when its shafts turn: the cross is rigid."""
    b, c, d = (values[name] for name in "bcd")
    first, second = np.array([c, 0, 1.0]), np.array([-np.sin(b), np.cos(b), d])
    first, second = first / np.sqrt(first @ first), second / np.sqrt(second @ second)
    return complex((turned(np.array([1.0, 0, 0]), angle) @ first) @ (turned(SHAFT, out) @ second) - first @ second)


@pytest.mark.parametrize("off", [0.0, 0.15])
def test_both_axes_of_a_universal_joint(off: float) -> None:
    """The angle of the output shaft is the root of one equation; its derivatives by implicit differentiation."""
    points = {"E": 100 * SHAFT, "U": 100 * SHAFT + [-30, 45, 0], "V": 100 * SHAFT + [0, 0, 50]}
    text = HOOKE
    for name, place in points.items():
        text = text.replace(f"[{name}]", str(place.tolist()))
    values = {"b": np.radians(35) + off, "c": 0.1 + off, "d": -0.05 - off}
    for angle in (-0.7, 0.4, 1.0):
        found = at(model(text), [[angle]], Request(parameters=("b", "c", "d")), **values)
        root = brentq(lambda out, q=angle: hooke(values, q, out).real, angle - 0.4, angle + 0.4, xtol=1e-15)
        assert found.values[0] == pytest.approx(root * SHAFT, abs=1e-12)
        by_root = hooke(values, angle, root + 1e-30j).imag
        assert found.jacobian is not None
        for k, name in enumerate("bcd"):
            by_axis = hooke({**values, name: values[name] + 1e-30j}, angle, root).imag
            assert found.jacobian[0, :, k] == pytest.approx(-by_axis / by_root * SHAFT, abs=1e-11)


LEGS = (
    HEAD
    + """
space: spatial
parameters: {u: 0.1, v: -0.2}
ground: {O: [0, 0, 0], GROUND}
bodies: {plate: {at: [0, 0, 0], points: {POINTS}}}
joints: {j: {between: [O, plate], type: TYPE, axis: [u, v, 1]}}
bars: {"l{i}": {each: {i: [COUNT]}, between: ["G{i}", "P{i}"]}}
actuators: {"q{i}": {each: {i: [COUNT]}, drives: "l{i}", zero: home}}
sensors:
  s: {kind: tcp, at: plate, reads: [x, y, z, rx, ry, rz], sigma: {position: 1 um, orientation: 1 urad}, frame: machine}
"""
)


PLACES = {
    "cylindrical": ("G1: [80, 10, 300], G2: [-320, 60, 20]", "P1: [80, 10, 5], P2: [-20, 70, 30]"),
    "planar": (
        "G1: [300, 50, 0], G2: [20, 280, 20], G3: [-60, -250, 9]",
        "P1: [80, 10, 5], P2: [-20, 70, 3], P3: [-50, -9, 6]",
    ),
}


@pytest.mark.parametrize("kind", PLACES)
def test_joints_that_slide_and_turn(kind: str) -> None:
    """A cylindrical joint turns about its axis and slides along it, a planar one turns about it and slides across."""
    ground, points = PLACES[kind]
    count = ground.count("G")
    text = LEGS.replace("TYPE", kind).replace("COUNT", ", ".join(str(k + 1) for k in range(count)))
    text = text.replace("GROUND", ground).replace("POINTS", points)
    readings = np.array([[0.002, -0.001, 0.002], [-0.002, 0.001, -0.001]])[:, :count]
    for u, v in ((0.1, -0.2), (0.3, 0.2)):
        axis = np.array([u, v, 1.0]) / np.sqrt(u * u + v * v + 1)
        for pose in at(model(text), readings, u=u, v=v).values:
            assert np.abs(np.cross(pose[3:], axis)).max() < 1e-13 and np.abs(pose[3:]).max() > 1e-4
            out = np.cross(pose[:3], axis) if kind == "cylindrical" else pose[:3] @ axis
            assert np.abs(out).max() < 1e-13 and np.abs(pose[:3]).max() > 1e-4
    found = jacobian_check(text.replace("scale: 0.01", "scale: 0.1"), readings, np.array([0.3, 0.1]))
    assert found.deviation < 1e-6 and found.null == ()


def test_the_axis_of_an_angle_sensor() -> None:
    """An inclinometer whose axis is tilted reads the angle of the line in the plane across it."""
    text = (
        HEAD
        + """
space: spatial
parameters: {u: 0.1, v: -0.2}
ground: {O: [0, 0, 0], T: [100, 40, 30]}
bodies: {arm: {at: [0, 0, 0]}}
joints: {j: {between: [O, arm], type: revolute, axis: y}}
actuators: {q: {turns: arm}}
sensors: {s: {kind: angle, at: arm, to: T, axis: [u, v, 1], sigma: 1 urad}}
"""
    )

    def angle(u: complex, v: complex, q: float) -> complex:
        axis = np.array([u, v, 1.0]) / np.sqrt(u * u + v * v + 1)
        first = np.array([1.0, 0, 0]) - axis[0] * axis
        first = first / np.sqrt(first @ first)
        line = turned(np.array([0.0, 1, 0]), q).T @ np.array([0.1, 0.04, 0.03])
        x, y = line @ first, line @ np.cross(axis, first)
        slope = (x.real * np.imag(y) - y.real * np.imag(x)) / (x.real**2 + y.real**2)
        return complex(np.arctan2(np.real(y), np.real(x)), slope)

    for u, v in ((0.1, -0.2), (0.5, 0.4)):
        found = at(model(text), [[0.3]], Request(parameters=("u", "v")), u=u, v=v)
        assert found.jacobian is not None
        assert found.values[0, 0] == pytest.approx(angle(u, v, 0.3).real, abs=1e-14)
        assert found.jacobian[0, 0, 0] == pytest.approx(angle(u + 1e-30j, v, 0.3).imag / 1e-30, abs=1e-14)
        assert found.jacobian[0, 0, 1] == pytest.approx(angle(u, v + 1e-30j, 0.3).imag / 1e-30, abs=1e-14)


CLOSED = (
    HEAD
    + """
space: spatial
parameters: {a: 0, b: 0.2}
ground: {O: [0, 0, 0], G: [0, G_Y, 250], H: [-100, 0, 0]}
bodies:
  arm: {at: [0, 0, 0], points: {Q: [0, 100, 0]}}
  slide: {at: [0, 0, 60], points: {P: [5, 6, 7]}}
  flap: {at: [-100, 0, 0]}
joints:
  hinge: {between: [O, arm], type: revolute, axis: x}
  leg: {between: [O2, slide], type: prismatic, axis: [sin(a), b, cos(a)]}
  back: {between: [H, flap], type: revolute, axis: "y", stiffness: {rz: 1 kNm/rad}}
bars: {b: {between: [G, Q], length: 200}}
actuators: {q: {drives: leg, DRIVE}}
loads: {twist: {at: flap, moment: [1 Nm, 10 Nm, 2 Nm]}}
sensors:
  s: {kind: tcp, at: P, reads: [x, y, z], sigma: 1 um, frame: machine}
  t: {kind: tcp, at: flap, reads: [rx, ry, rz], sigma: 1 urad, frame: machine}
"""
)


@pytest.mark.parametrize("drive", ["redundant: false", "stiffness: 1 kN/mm"])
def test_an_axis_goes_with_its_body_when_the_drawing_is_closed(drive: str) -> None:
    """The arm is drawn flat, but its bar holds it at 30 deg: the axis that it carries is turned with it.

    Another body, with a moment on its hinge, has nothing to do with the axis.
    """
    text = CLOSED.replace("DRIVE", drive).replace("G_Y", repr(float(100 * np.cos(np.pi / 6))))
    text = text.replace("points: {Q: [0, 100, 0]}", "points: {Q: [0, 100, 0], O2: [0, 0, 0]}")
    up = turned(np.array([1.0, 0, 0]), np.pi / 6)
    for a, b in ((0.0, 0.2), (0.4, -0.3)):
        way = np.array([np.sin(a), b, np.cos(a)]) / np.sqrt(1 + b * b)
        found = at(model(text), [[0.05], [0.08]], a=a, b=b).values
        for row, travel in zip(found, (0.05, 0.08), strict=True):
            assert row[:3] == pytest.approx(up @ (travel * way + [0.005, 0.006, 0.007]), abs=1e-13)
            assert row[3:] == pytest.approx([0, 0.01, 0], abs=1e-13)


def test_a_universal_end_of_a_beam_with_any_two_axes_is_at_rest_as_drawn() -> None:
    text = (
        HEAD
        + """
space: spatial
parameters: {t: 0.3}
ground: {O: [0, 0, 0], G1: [300, 0, 200], G2: [0, 300, 200]}
bodies: {plate: {at: [0, 0, 200], points: {P1: [50, 0, 0], P2: [0, 50, 0]}}}
beams:
  leg: {between: [O, plate], EA: 1 MN, EI: 1 kN*m^2, GJ: 1 kN*m^2,
        ends: [{joint: universal, axes: [x, [t, 1, 0]], stiffness: {rz: 100 Nm/rad}}, fixed]}
bars: {b1: {between: [G1, P1]}, b2: {between: [G2, P2]}}
sensors:
  s: {kind: tcp, at: plate, reads: [x, y, z, rx, ry, rz], sigma: {position: 1 um, orientation: 1 urad}, frame: machine}
"""
    )
    for t in (0.3, 0.6):
        assert at(model(text), [[]], t=t).values[0] == pytest.approx([0, 0, 0.2, 0, 0, 0], abs=1e-14)


def test_a_free_motion_is_named_by_its_body() -> None:
    text = arm(NOMINAL).replace("q2: {turns: lower}, ", "")
    assert compiled(text).mobility.uncontrolled == ("rotation of lower",)


def test_a_machine_with_turned_axes_goes_to_other_processes() -> None:
    """As those of `study --jobs`: it is there what it is here."""
    here = model(arm(NOMINAL))
    there = cloudpickle.loads(cloudpickle.dumps(here))
    values = {**NOMINAL, "c": 0.2, "d": -0.2, "e": np.radians(9)}
    one, other = (at(m, [[0.1, -0.1, 0.01]], Request(parameters=("c", "e")), **values) for m in (here, there))
    assert np.array_equal(one.values, other.values) and np.array_equal(one.jacobian, other.jacobian)


def test_tilts_of_a_hinge_are_identified(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Planted, simulated without noise, found again; the set-up of the documentation."""
    monkeypatch.chdir(tmp_path)
    Path("hinge.yaml").write_text(written_files(LANGUAGE.read_text(encoding="utf-8"))["hinge.yaml"])
    Path("turns.csv").write_text("q [deg]\n" + "".join(f"{k}\n" for k in range(-160, 161, 40)))
    Path("planted.yaml").write_text("parameters: {ex: 0.0015, ey: -0.0008, r: 200.05}\n")
    assert run("simulate", "hinge.yaml", "turns.csv", "-p", "planted.yaml", "--noise", "none", "-o", "m.csv").code == 0
    done = run("calibrate", "hinge.yaml", "m.csv", "--holdout", "none", "--json")
    assert done.code == 0, done.err
    found = {p["name"]: p["value"] for p in done.json["parameters"]}
    assert [found["ex"], found["ey"]] == pytest.approx([0.0015, -0.0008], abs=1e-9)
    assert found["r"] == pytest.approx(200.05, abs=1e-6)


def test_poses_are_reached_with_turned_axes(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Readings for places of the tool, by the nominal machine; where they lead it and the machine with other axes."""
    monkeypatch.chdir(tmp_path)
    Path("arm.yaml").write_text(arm(NOMINAL))
    values = {**NOMINAL, "c": 0.2, "d": -0.2, "e": np.radians(9)}
    Path("p.yaml").write_text("parameters: {c: 0.2, d: -0.2, e: 9}\n")
    start = product_of_exponentials(NOMINAL, np.array([0.1, -0.1, 0.01]))[:3] * 1e3
    grid = ",".join(f"{axis}={at - 6}:{at + 6}:2" for axis, at in zip("xyz", start, strict=True))
    done = run("simulate", "arm.yaml", "--grid", grid, "-p", "p.yaml", "--noise", "none", "-o", "m.csv")
    assert done.code == 0 and done.err.endswith("8 rows simulated\n"), done.err
    readings = np.stack([column("m.csv", q) for q in ("q1", "q2", "q3")], axis=1) * [np.pi / 180, np.pi / 180, 1e-3]
    places = np.stack([column("m.csv", axis) for axis in "xyz"], axis=1)
    corners = np.array([[x, y, z] for x in (-6, 6) for y in (-6, 6) for z in (-6, 6)]) + start
    for place, corner, reading in zip(places, corners, readings, strict=True):
        assert product_of_exponentials(NOMINAL, reading)[:3] * 1e3 == pytest.approx(corner, abs=1e-9)
        assert product_of_exponentials(values, reading)[:3] * 1e3 == pytest.approx(place, abs=1e-9)
