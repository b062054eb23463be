"""Axes that depend on parameters: against products of exponentials, closed forms, and the same axes as numbers."""

from __future__ import annotations

import re
from itertools import product

import numpy as np
import pytest

from pkmcal_cli.base.rotation import Array, log
from pkmcal_cli.compiler import axes
from pkmcal_cli.prediction import Request
from tests.in_ci import in_ci
from tests.measured import jacobian_check, strained_values
from tests.support import at, model
from tests.test_jacobian import KINDS

HEAD = "units: {length: mm, angle: deg, force: N}\nranges: {length: 0.1, angle: 0.5, scale: 0.01}\n"


def turned(axis: Array, angle: complex) -> Array:
    """Rodrigues' formula for an axis of any length, complex where a derivative is taken."""
    n = axis / np.sqrt(axis @ axis)
    k = np.array([[0, -n[2], n[1]], [n[2], 0, -n[0]], [-n[1], n[0], 0]])
    return np.asarray(np.eye(3) + np.sin(angle) * k + (1 - np.cos(angle)) * (k @ k))


ARM = (
    HEAD
    + """
space: spatial
parameters: {a: {nominal: A, unit: deg}, b: B, c: C, d: D, e: E, r: 90}
ground: {O: [10, 20, 30]}
bodies:
  upper: {at: [10, 20, 30], turn: [10, 20, -30], points: {X: [60, -20, 100]}}
  lower: {at: [50, 20, 150], points: {M: [0, 5, 0]}}
  slide: {at: [100, 30, 150], points: {P: [r, 5, 7]}}
joints:
  shoulder: {between: [O, upper], type: revolute, axis: AXIS1SPRING1}
  elbow: {between: [X, lower], type: revolute, axis: AXIS2SPRING2}
  leg: {between: [M, slide], type: prismatic, axis: AXIS3}
actuators: {q1: {turns: shoulder}, q2: {turns: lower}, q3: {drives: leg, zero: 50}}
sensors:
  s: {kind: tcp, at: P, reads: [x, y, z, rx, ry, rz], sigma: {position: 1 um, orientation: 1 urad}, frame: machine}
"""
)
NAMES = ("a", "b", "c", "d", "e", "r")
NOMINAL = {"a": np.radians(10), "b": 2.0, "c": 0.1, "d": -0.3, "e": np.radians(5), "r": 0.09}
OFF = {"a": np.radians(-25), "b": 1.2, "c": 0.4, "d": 0.2, "e": np.radians(35), "r": 0.095}
AXES = ("[sin(a), 0.2, b*cos(a)]", "[c, 1, d]", "[cos(e), 3*sin(e), c]")
TURN = np.radians([10.0, 20.0, -30.0])
READINGS = np.array([[0.0, 0.0, 0.0], [0.5, -0.7, 0.02], [-1.3, 1.1, -0.03], [2.0, 0.4, 0.05]])


def arm(values: dict[str, float], axes: tuple[str, ...] = AXES, springs: tuple[str, str] = ("", "")) -> str:
    """The arm with nominal values (SI); `springs`: stiffness of the revolute joints."""
    shown = {
        "A": np.degrees(values["a"]),
        "B": values["b"],
        "C": values["c"],
        "D": values["d"],
        "E": np.degrees(values["e"]),
    }
    head, tail = ARM.split("ground:")
    for letter, value in shown.items():
        head = head.replace(f": {letter},", f": {float(value)!r},")
    for k, axis in enumerate(axes):
        tail = tail.replace(f"AXIS{k + 1}", axis)
    for k, spring in enumerate(springs):
        tail = tail.replace(f"SPRING{k + 1}", spring and f", stiffness: {spring}")
    return head + "ground:" + tail


def along(values: dict[str, complex]) -> tuple[Array, Array, Array]:
    """The axes `AXES`, of any length."""
    a, b, c, d, e = (values[name] for name in "abcde")
    return (
        np.array([np.sin(a), 0.2, b * np.cos(a)]),
        np.array([c, 1.0, d]),
        np.array([np.cos(e), 3 * np.sin(e), c]),
    )


def product_of_exponentials(values: dict[str, complex], reading: Array) -> Array:
    """x, y, z and the orientation matrix at one reading, flat (12,)."""
    first, second, third = along(values)
    shoulder, elbow = turned(first, reading[0]), turned(second, reading[1])
    upper = turned(TURN, np.linalg.norm(TURN))
    lower = shoulder @ elbow
    out = np.array([0.01, 0.02, 0.03]) + shoulder @ upper @ np.array([0.06, -0.02, 0.1])
    out = out + lower @ (np.array([0.0, 0.005, 0.0]) + (0.05 + reading[2]) * third / np.sqrt(third @ third))
    return np.concatenate([out + lower @ np.array([values["r"], 0.005, 0.007]), lower.ravel()])


@pytest.mark.parametrize("values", [NOMINAL, OFF], ids=["nominal", "off"])
def test_a_serial_arm_is_the_product_of_its_exponentials(values: dict[str, float]) -> None:
    found = at(model(arm(NOMINAL)), READINGS, **values).values
    for row, reading in zip(found, READINGS, strict=True):
        expected = product_of_exponentials(values, reading)
        assert row[:3] == pytest.approx(expected[:3], abs=1e-15)
        assert row[3:] == pytest.approx(log(expected[3:].reshape(3, 3)), abs=1e-14)


@pytest.mark.parametrize("values", [NOMINAL, OFF], ids=["nominal", "off"])
def test_derivatives_by_parameters_of_axes_are_exact(values: dict[str, float]) -> None:
    found = at(model(arm(NOMINAL)), READINGS, Request(parameters=NAMES), **values)
    assert found.jacobian is not None
    for k, name in enumerate(NAMES):
        for row, reading in enumerate(READINGS):
            stepped = product_of_exponentials({**values, name: values[name] + 1e-30j}, reading)
            assert found.jacobian[row, :3, k] == pytest.approx(stepped[:3].imag / 1e-30, abs=1e-14)
            matrix = stepped[3:].reshape(3, 3)
            turn = log(matrix[None])[0].imag / 1e-30  # `log` passes complex steps; it has tests of its own
            assert found.jacobian[row, 3:, k] == pytest.approx(turn, abs=1e-12)


def test_derivatives_by_drives_that_carry_such_axes() -> None:
    """The first axis in numbers, so that its drive sets the angle of a body on which a turned axis stands."""
    first = str([float(v) for v in along(NOMINAL)[0]])
    text = arm(NOMINAL, (first, *AXES[1:])).replace("a: {nominal: 10.0, unit: deg}, b: 2.0, ", "")
    values = {**OFF, "a": NOMINAL["a"], "b": NOMINAL["b"]}
    own = {name: value for name, value in values.items() if name not in "ab"}
    found = at(model(text), READINGS, Request(parameters=tuple(own), by_drive=True), **own)
    assert found.jacobian is not None and found.by_drive is not None
    for row, reading in enumerate(READINGS):
        for k, name in enumerate(own):
            stepped = product_of_exponentials({**values, name: values[name] + 1e-30j}, reading)
            assert found.jacobian[row, :3, k] == pytest.approx(stepped[:3].imag / 1e-30, abs=1e-14)
        for k in range(3):
            stepped = product_of_exponentials(values, reading + 1e-30j * np.eye(3)[k])
            assert found.by_drive[row, :3, k] == pytest.approx(stepped[:3].imag / 1e-30, abs=1e-14)


ELASTIC = "{rx: 3 kNm/rad, ry: 1 kNm/rad, x: 2 kN/mm}"


@pytest.mark.parametrize("springs", [("", ""), ("", ELASTIC), ("{rz: 1 kNm/rad}", ELASTIC)])
def test_parameters_do_what_numbers_do(springs: tuple[str, str]) -> None:
    """Where the parameters are is the same as what the file says, also of springs across the axes, and of loads.

    The file draws the elbow where it is: an elastic joint that is drawn apart closes elsewhere with other axes.
    """
    load = "gravity: [1, 2, -9.81]\nloads: {f: {at: P, force: [30, 40, 50], moment: [1 Nm, 2 Nm, -3 Nm]}}\n"
    numbers = tuple(str(axis.tolist()) for axis in along(OFF))
    elbow = np.array([10.0, 20.0, 30.0]) + turned(TURN, np.linalg.norm(TURN)).real @ np.array([60.0, -20.0, 100.0])
    texts = load + arm(NOMINAL, springs=springs), load + arm(OFF, numbers, springs)
    drawn, other = (text.replace("lower: {at: [50, 20, 150]", f"lower: {{at: {elbow.tolist()}") for text in texts)
    by_parameters = at(model(drawn), READINGS, **OFF).values
    by_numbers = at(model(re.sub("parameters: .*", "parameters: {r: 90}", other)), READINGS, r=OFF["r"]).values
    assert by_parameters == pytest.approx(by_numbers, abs=1e-12)
    rigid = at(model(arm(NOMINAL)), READINGS, **OFF).values
    yields = np.abs(by_parameters - rigid)[:, :3].max()
    assert (yields > 1e-4) == bool(springs[1]), "but a spring beside a rigid drive does nothing"


RAIL = (
    HEAD
    + """
space: spatial
parameters: {g: 4, h: -7, a: 20, b: 0.1}
frames: {f: {at: [100, 50, -20], turn: [g, 0.3, h]}}
guides: {rail: {frame: f, at: [5, 6, 7], along: [2*cos(a), b, 2*sin(a)]}}
bodies: {car: {guide: rail, at: 30, points: {P: [10, -20, 30]}}}
actuators: {q: {moves: car, DRIVE}}
sensors:
  s: {kind: tcp, at: P, reads: [x, y, z, rx, ry, rz], sigma: {position: 1 um, orientation: 1 urad}, frame: machine}
"""
)


def on_the_rail(values: dict[str, complex], travel: float) -> Array:
    """The point of a carriage, by hand: the guide is turned in its frame, the carriage has the axes of the frame."""
    vector = np.array([values["g"], np.radians(0.3), values["h"]])
    frame = turned(vector, np.sqrt(vector @ vector))
    way = np.array([2 * np.cos(values["a"]), values["b"], 2 * np.sin(values["a"])])
    inside = np.array([0.005, 0.006, 0.007]) + travel * way / np.sqrt(way @ way) + np.array([0.01, -0.02, 0.03])
    return np.array([0.1, 0.05, -0.02]) + frame @ inside


@pytest.mark.parametrize("drive", ["", "stiffness: 1 kN/mm"])
@pytest.mark.parametrize("off", [0.0, 0.4])
def test_a_guide_points_where_parameters_say(drive: str, off: float) -> None:
    nominal = {"g": np.radians(4), "h": np.radians(-7), "a": np.radians(20), "b": 0.1}
    values = {name: value + off for name, value in nominal.items()}
    readings = np.array([[-0.3], [0.03], [0.5]])
    found = at(
        model(RAIL.replace(", DRIVE", f", {drive}" if drive else "")),
        readings,
        Request(parameters=tuple(values)),
        **values,
    )
    assert found.jacobian is not None
    for row, reading in enumerate(readings):
        assert found.values[row, :3] == pytest.approx(on_the_rail(values, reading[0]), abs=1e-14)
        for k, name in enumerate(values):
            slope = on_the_rail({**values, name: values[name] + 1e-30j}, reading[0]).imag / 1e-30
            assert found.jacobian[row, :3, k] == pytest.approx(slope, abs=1e-14)
    assert np.abs(found.jacobian[:, 3:, 2:]).max() < 1e-15, "the carriage keeps the axes of the frame"


def test_an_elastic_guide_is_followed_and_yields_across() -> None:
    """Springs act across the tilted guide: without a force the carriage is on it, a force moves it by F/k across."""
    text = (
        RAIL.replace("2*cos(a), b, 2*sin(a)", "1, b, a").replace("a: 20, b: 0.1", "a: 0, b: 0").replace(", DRIVE", "")
    )
    text = text.replace("[g, 0.3, h]", "[g, 0, h]").replace("g: 4, h: -7", "g: 0, h: 0")
    springs = "stiffness: {y: 2 kN/mm, z: 3 kN/mm, rx: 1 kNm/rad, ry: 2 kNm/rad, rz: 4 kNm/rad}"
    text = text.replace("rail: {frame", f"rail: {{{springs}, frame")
    values = {"a": 0.3, "b": -0.2, "g": 0.0, "h": 0.0}
    way = np.array([1.0, -0.2, 0.3]) / np.linalg.norm([1.0, -0.2, 0.3])
    place = np.array([0.115, 0.036, 0.017]) + 0.4 * way
    free = at(model(text), [[0.4]], **values).values[0]
    assert free == pytest.approx([*place, 0, 0, 0], abs=1e-14)
    up = np.array([0.0, 0, 1]) - way[2] * way
    z = up / np.linalg.norm(up)
    y = np.cross(z, way)
    for across, stiffness in ((y, 2e6), (z, 3e6)):
        push = ", ".join(repr(float(f)) for f in 0.01 * across)
        loaded = text + f"loads: {{f: {{at: car, force: [{push}]}}}}\n"
        moved = at(model(loaded), [[0.4]], **values).values[0] - free
        assert moved[:3] == pytest.approx(0.01 / stiffness * across, abs=1e-13)


TILTED = {
    "spatial": {
        "along: z,": "along: [t1, t2, 1],",
        "axis: x, stiffness: {rz: kt}": "axis: [1, t3, t4], stiffness: {rz: kt}",
        "axis: [0.2, 0, 1]": "axis: [0.2, t5, 1 + t6]",
        "type: prismatic}": "type: prismatic, axis: [22 + t7, -18 + t8, 40]}",
    },
    "planar": {"along: x,": "along: [1, t1],", "axis: y": "axis: [t2, 1]"},
}


@pytest.mark.parametrize(
    ("strained", "space"), in_ci(["True-planar"], product([False, True], TILTED))
)
def test_derivatives_in_closed_loops(space: str, strained: bool) -> None:
    """Every kind of joint, guide and drive, rigid and elastic, at poses that strain them, with axes off nominal."""
    text, moves = KINDS[space]
    for old, new in TILTED[space].items():
        assert text.count(old) == 1, old
        text = text.replace(old, new)
    count = len(set(re.findall(r"\bt\d+\b", text)))
    text = text.replace(
        "parameters:\n",
        f'parameters:\n      "t{{i}}": {{each: {{i: {list(range(1, count + 1))}}}, nominal: 0}}\n',
    )
    machine = model(text)
    values = strained_values(text, 0) if strained else None
    found = jacobian_check(text, machine.reference_readings + np.array(moves), values)
    assert found.deviation < 1e-6, found.worst
    assert found.null == () and found.columns == len(machine.names) + len(machine.actuators)
    assert {f"t{k + 1}" for k in range(count)} <= set(machine.names)


TILTED_HINGE = (
    HEAD
    + """
space: spatial
parameters: {ex: 0, ey: 0}
ground: {O: [0, 0, 0]}
bodies: {arm: {at: [0, 0, 0], points: {P: [200, 0, 50]}}}
joints: {hinge: {between: [O, arm], type: revolute, axis: [ex, ey, 1]}}
actuators: {q: {turns: arm}}
sensors: {tracker: {at: P, reads: [x, y, z], sigma: 10 um, frame: machine}}
"""
)


def test_the_turn_of_an_axis_is_computed_once_for_all_that_it_carries(monkeypatch: pytest.MonkeyPatch) -> None:
    """Both sides of a hinge need all its numbers in their own axes: the turn was computed 36 times."""
    asked = list[Array]()

    def counted(rotation: Array) -> Array:
        asked.append(rotation)
        return log(rotation)

    monkeypatch.setattr(axes, "log", counted)
    made = model(TILTED_HINGE)
    asked.clear()
    values = {n: 1e-3 * (k + 1) for k, n in enumerate(made.names)}
    made.topology.coefficients.values(values)
    assert len(asked) == 2
    made.topology.coefficients.jacobian(values, made.names)
    assert len(asked) == 2 + 2 * len(made.names)
