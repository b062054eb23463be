"""From declarations to the engine: mechanisms with closed forms, drive laws, the assembled drawing.

Positions of 0.5 m round to 1e-16 m; a solve adds a few of these: 1e-13 m where nothing is soft.
"""

from __future__ import annotations

import numpy as np
import pytest
from scipy.optimize import brentq

from pkmcal_cli.base.rotation import Array
from pkmcal_cli.prediction import Request, Rows, predict
from pkmcal_cli.prediction.inverse_kinematics import drive_positions
from tests.structures import point
from tests.support import at, compiled, errors_of, model, overlay, poses_of, truth

MM = "units: {length: mm, angle: deg, force: N}"
PROBE = "{kind: tcp, at: %s, reads: [%s], sigma: {position: 1 um, orientation: 1 urad}, frame: machine}"


FIVE_BAR = f"""
    {MM}
    space: planar
    ground: {{A: [0, 0], B: [300, 0]}}
    nodes: {{tcp: [150, 300]}}
    bodies:
      left: {{at: [0, 0], turn: 90, points: {{K: [150, 0]}}}}
      right: {{at: [300, 0], turn: 80, points: {{R: [150, 0]}}}}
    joints:
      a: {{between: [A, left], type: revolute}}
      b: {{between: [B, right], type: revolute}}
    bars: {{one: {{between: [K, tcp], length: 250}}, two: {{between: [R, tcp], length: 250}}}}
    actuators: {{q1: {{turns: left}}, q2: {{turns: right}}}}
    sensors: {{s: {PROBE % ("tcp", "x, y")}}}
    """


def meeting(first: Array, second: Array, reach: float) -> Array:
    """Upper meeting point of two circles of equal radius."""
    half = (second - first) / 2
    across = np.array([-half[1], half[0]]) / np.hypot(*half)
    out: Array = first + half + across * np.sqrt(reach**2 - half @ half)
    return out


def test_five_bar_linkage_of_cranks() -> None:
    """Readings are crank angles against x; the TCP by circles. Cranks too far apart are out of reach."""
    machine = model(FIVE_BAR)
    for left, right in np.radians([[90, 90], [120, 40], [100, 70], [60, 100], [-10, 80]]):
        knees = 0.15 * np.array([[np.cos(left), np.sin(left)], [np.cos(right), np.sin(right)]]) + [[0, 0], [0.3, 0]]
        assert np.abs(at(machine, np.array([left, right])).values[0] - meeting(*knees, 0.25)).max() < 1e-13
    found = predict(machine, machine.nominal, Rows.at(np.radians([[130, 20], [150, 10]])))
    assert [found.reason(k)[:12] for k in range(2)] == ["out of reach"] * 2


HINGED = """
{head}
space: spatial
ground: {{A: [-100, 0, 0], U: {U}, V: {V}}}
bodies:
  input: {{at: [-100, 0, 0], points: {{I: [100, 0, 0]}}}}
  output: {{at: [0, 0, 0], points: {{O: [0, 0, 0], E: {B}}}}}
joints:
  first: {{between: [A, input], type: revolute, axis: x}}
  cross: {{between: [I, O], type: universal, axes: [[0, 0, 1], {across}]}}
bars: {{u: {{between: [U, E]}}, v: {{between: [V, E]}}}}
actuators: {{q: {{turns: first}}}}
sensors: {{s: {probe}}}
"""


def test_universal_joint_turns_as_hooke_says() -> None:
    """Shafts at 35 degrees: tan(out) = tan(in) cos(35 deg) with the first axis across both shafts at 0."""
    bend = np.radians(35)
    along, across = np.array([np.cos(bend), np.sin(bend), 0]), np.array([-np.sin(bend), np.cos(bend), 0])
    text = HINGED.format(
        head=MM,
        B=point(100 * along),
        U=point(100 * along + 50 * across),
        V=point(100 * along + [0, 0, 50]),
        across=point(across),
        probe=PROBE % ("output", "rx, ry, rz"),
    )
    for angle in np.radians([-40.0, 20.0, 60.0, 85.0]):
        found = at(model(text), np.array([angle])).values[0]
        assert np.abs(found - np.arctan(np.tan(angle) * np.cos(bend)) * along).max() < 1e-12


RSSR = """
units: {length: mm, angle: deg, force: N}
space: spatial
ground: {A: [0, 0, 0], B: [300, 0, 50]}
bodies:
  crank: {at: [0, 0, 0], points: {K: [0, 80, 0]}}
  rocker: {at: [300, 0, 50], points: {R: [0, 0, 150]}}
  coupler: {at: [0, 80, 0], points: {C: [0, 0, 0], D: [300, -80, 200]}}
joints:
  a: {between: [A, crank], type: revolute, axis: z}
  b: {between: [B, rocker], type: revolute, axis: y}
  c: {between: [K, C], type: spherical}
  d: {between: [D, R], type: spherical}
actuators: {q: {turns: a}}
sensors: {s: {kind: tcp, at: rocker, reads: [rx, ry, rz], sigma: 1 urad, frame: machine}}
"""


def test_spatial_four_bar_linkage() -> None:
    """Hinge, two ball joints, hinge: the coupler keeps the distance of its ends, and spins idly."""
    made = compiled(RSSR)
    assert made.mobility.free_motions == ("rotation of coupler",)

    def stretch(rocker: float, crank: float) -> float:
        near = np.array([-80 * np.sin(crank), 80 * np.cos(crank), 0])
        far = np.array([300 + 150 * np.sin(rocker), 0, 50 + 150 * np.cos(rocker)])
        return float(np.linalg.norm(far - near) - np.sqrt(300**2 + 80**2 + 200**2))

    for crank in np.radians([10.0, 40.0, 90.0, -30.0]):
        rocker = brentq(stretch, -0.8, 0.6, args=(crank,), xtol=1e-15)
        assert np.abs(at(made.model, np.array([crank])).values[0] - [0, rocker, 0]).max() < 1e-12


TELESCOPE = """
parameters: {k3: null}
nodes: {u: [360, 560], v: [360, 470]}
bars: {leg: null}
beams:
  outer: {between: [P8, u], ends: [revolute, fixed], length: 100, EA: 4000000, EI: 1e12}
  inner: {between: [v, tcp], ends: [fixed, revolute], length: l3 - 100, EA: 8000000, EI: 1e12}
joints: {slide: {between: [u, v], type: prismatic}}
actuators: {q3: {drives: slide, offset: null}}
"""


def test_a_telescope_of_two_beams_is_a_leg() -> None:
    """Biglide: leg as one bar of k3, or as two beams in series with the drive between them, k3 = 1/(L1/E1 + L2/E2)."""
    beams = model(overlay("biglide", TELESCOPE))
    readings = truth("biglide").inverse(poses_of("biglide", 6))
    values = errors_of(beams, 1e-3)
    series = 1 / (0.1 / 4e6 + (values["l3"] - 0.1) / 8e6)
    one, other = (
        at(m, readings, Request(forces=True), **v)
        for m, v in ((beams, values), (model("biglide"), {**values, "k3": series}))
    )
    assert np.abs(one.values - other.values).max() < 1e-13
    assert one.forces == pytest.approx(other.forces, rel=1e-8)
    assert one.energy == pytest.approx(other.energy, rel=1e-8)


@pytest.mark.parametrize(
    ("name", "drive"), [("triglide", "q3"), ("biglide", "q1"), ("scissors", "q2"), ("delta4", "q4")]
)
def test_a_drive_that_yields(name: str, drive: str) -> None:
    """`stiffness` of a carriage against the simulator's spring about the set value."""
    simulator, machine = truth(name), model(overlay(name, f"actuators: {{{drive}: {{stiffness: 3 kN/mm}}}}"))
    readings, values = simulator.inverse(poses_of(name, 6)), errors_of(machine, 3e-4)
    found = at(machine, readings, Request(forces=True), **values)
    true = simulator.forward(readings, values, stiffness={drive: 3e6})
    assert np.abs(found.values - true.tcp[:, : found.values.shape[1]]).max() < 1e-12
    assert found.forces == pytest.approx(true.drive_force, rel=1e-7, abs=1e-4)


def test_drive_laws() -> None:
    """Travel = zero + scale * ratio * reading, the zero and the scale parameters too."""
    text = """
    parameters: {z1: {nominal: 5, range: 1}, s2: {nominal: 2, range: 1e-3}}
    actuators: {q1: {zero: z1}, q2: {scale: s2, ratio: 0.25}, q3: {scale: 5/360, unit: deg}}
    """
    machine, plain = model(overlay("triglide", text)), model("triglide")
    travel = truth("triglide").inverse(poses_of("triglide", 4)) + 1e-4
    readings = np.column_stack([travel[:, 0] - 0.006, travel[:, 1] / (2.001 * 0.25), travel[:, 2] / 5e-3 * 2 * np.pi])
    found = at(machine, readings, z1=0.006, s2=2.001)
    assert np.abs(found.values - at(plain, travel).values).max() < 1e-13
    assert machine.actuators[2].unit == "deg"


def test_two_things_share_a_parameter() -> None:
    shared = model(overlay("triglide", "parameters: {l2: null}\nbars: {rod2: {length: l1}}"))
    readings = truth("triglide").inverse(poses_of("triglide", 4))
    one, other = at(shared, readings, l1=0.3007), at(model("triglide"), readings, l1=0.3007, l2=0.3007)
    assert np.abs(one.values - other.values).max() < 1e-13


def test_overlay_without_the_third_leg_is_the_machine_with_a_soft_one() -> None:
    """k3 of 1 N/m leaves the third rod no say: 1e-7 of the others' stiffness, errors of 0.3 mm."""
    part, whole = model("triglide-nonredundant"), model("triglide")
    readings, values = truth("triglide").inverse(poses_of("triglide", 4)), errors_of(part, 3e-4)
    soft = at(whole, readings, **values, k3=1.0).values
    assert np.abs(at(part, readings[:, :2], **values).values - soft).max() < 1e-10


def test_a_rounded_drawing_gives_no_prestress() -> None:
    """The TCP and carriages drawn up to 5 mm off: the same machine; lengths are given, so nothing is strained."""
    rough = compiled(overlay("triglide", "nodes: {tcp: [355, 278]}\nbodies: {c1: {at: 120}, c3: {at: 951}}"))
    assert rough.gaps == ()
    readings = truth("triglide").inverse(poses_of("triglide", 4))
    found = at(rough.model, readings, Request(forces=True))
    assert np.abs(found.values - at(model("triglide"), readings).values).max() < 1e-13
    assert found.energy.max() < 1e-15
    assert at(rough.model, rough.model.reference_readings, Request(forces=True)).energy[0] < 1e-15


def test_natural_lengths_come_from_the_drawing() -> None:
    """Rods without `length` take that of the assembled drawing: no strain there, whatever the offsets' errors."""
    text = """
    parameters: {l1: null, l2: null, l3: null}
    bars: {rod1: {length: null}, rod2: {length: null}, rod3: {length: null}}
    bodies: {c1: {at: 120}, c2: {at: 600}, c3: {at: 950}}
    """
    machine = model(overlay("triglide", text))
    assert at(machine, machine.reference_readings, Request(forces=True)).energy[0] < 1e-15
    found = at(machine, np.array([0.12, 0.6, 0.95])).values[0]
    assert np.abs(found - [0.36, 0.275]).max() < 1e-13


def test_a_drawing_that_does_not_close() -> None:
    """A fixed node 30 mm too far for two rigid rods of 300 mm: the gap is told, at the member, with its size."""
    text = f"""
    {MM}
    space: planar
    ground: {{A: [0, 0], B: [630, 0]}}
    nodes: {{tcp: [310, 20]}}
    bars: {{one: {{between: [A, tcp], length: 300, k: 1e4}}, two: {{between: [B, tcp], length: 300, k: 1e4}}}}
    sensors: {{s: {PROBE % ("tcp", "x, y")}}}
    """
    found = compiled(text).gaps
    assert {g.element for g in found} == {"one", "two"}
    assert {g.strain for g in found} == {"elongation"}
    assert sum(g.value for g in found) == pytest.approx(0.03, rel=0.1)  # both rods, and the angle between them


def test_passive_links_by_boundary_conditions() -> None:
    """Eq. 9: a node held in x slides along y on two springs; held in all, nothing moves."""
    text = f"""
    {MM}
    space: planar
    ground: {{A: [0, 100], B: [300, 0]}}
    nodes: {{tcp: {{at: [0, 0], fixed: [x]}}, still: {{at: [300, 100], fixed: true}}}}
    bars:
      up: {{between: [A, tcp], k: 1000}}
      side: {{between: [B, tcp], k: 1000}}
      post: {{between: [still, A], k: 1000}}
    loads: {{push: {{at: tcp, force: [500, -20]}}}}
    sensors: {{s: {PROBE % ("tcp", "x, y")}}}
    """
    found = at(model(text), np.zeros((1, 0)), Request(method="linear")).values[0]
    assert np.abs(found - [0, -20e-6]).max() < 1e-15


ARM = """
units: {length: mm, angle: deg, force: N}
space: planar
ground: {O: [0, 0]}
bodies:
  upper: {at: [0, 0], turn: 30, points: {P: [100, 0]}}
  lower: {at: [86.60254037844386, 50], turn: 90, points: {T: [80, 0]}}
joints: {shoulder: {between: %s, type: revolute}, elbow: {between: %s, type: revolute}}
actuators: {q1: {turns: shoulder}, q2: %s}
sensors: {s: {at: T, reads: [x, y], sigma: 1 um, frame: machine}}
"""


@pytest.mark.parametrize("ends", [("[O, upper]", "[P, lower]"), ("[upper, O]", "[lower, P]")])
@pytest.mark.parametrize("elbow", ["{turns: elbow}", "{turns: lower}", "{turns: elbow, stiffness: 1e15}"])
def test_a_crank_on_a_moving_body_is_read_against_it(ends: tuple[str, str], elbow: str) -> None:
    """An arm of two links: the same law whichever way the joint is written, with and without drive stiffness."""
    machine = model(ARM % (*ends, elbow))
    assert np.degrees(machine.reference_readings) == pytest.approx([30, 60])
    readings = np.radians([[30, 60], [30, 90], [0, 60], [-170, -120]])
    upper, lower = readings[:, 0], readings.sum(axis=1)
    tip = [0.1 * np.cos(upper) + 0.08 * np.cos(lower), 0.1 * np.sin(upper) + 0.08 * np.sin(lower)]
    assert np.abs(at(machine, readings).values - np.transpose(tip)).max() < 1e-9


FOUR_BAR = """
units: {{length: mm, angle: deg, force: N}}
space: {space}
ground: {{O: [0, 0{z}], Q: [200, 0{z}]}}
bodies:
  crank: {{at: [0, 0{z}], turn: {crank}, points: {{P: [100, 0{z}]}}}}
  arm: {{at: [200, 0{z}], turn: {arm}, points: {{S: [100, 0{z}]}}}}
joints: {{j: {{between: [O, crank], type: revolute{axis}}}, k: {{between: [Q, arm], type: revolute{axis}}}}}
bars: {{coupler: {{between: [P, S], length: 200}}}}
actuators: {{q: {{turns: j}}}}
sensors: {{s: {{at: arm, reads: [rz], sigma: 1 urad, frame: machine}}}}
"""
PLANE = {"space": "planar", "z": "", "crank": "55", "arm": "70", "axis": ""}
SPACE = {"space": "spatial", "z": ", 0", "crank": "[0, 0, 55]", "arm": "[0, 0, 70]", "axis": ", axis: z"}


@pytest.mark.parametrize(("words", "zero"), [(PLANE, 0.0), (SPACE, 55.0)], ids=["planar", "spatial"])
def test_angles_count_from_the_file_however_roughly_it_is_drawn(words: dict[str, str], zero: float) -> None:
    """Parallel cranks of 100 mm, drawn 15 deg apart: what is read does not depend on how the drawing was closed."""
    machine, angles = model(FOUR_BAR.format(**words)), np.array([[40.0], [60.0], [75.0]])
    found = at(machine, np.radians(angles - zero)).values
    assert np.abs(found - np.radians(angles - 70.0)).max() < 1e-9
    assert machine.tool.reference[5] == pytest.approx(machine.reference_readings[0] + np.radians(zero - 70.0))
    back = drive_positions(machine, np.array([[np.nan] * 5 + [np.radians(-20.0)]])).readings
    assert np.degrees(back[0, 0]) == pytest.approx(50.0 - zero)
