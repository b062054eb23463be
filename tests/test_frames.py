"""Frames: other programs' results, closed forms, the paper's 1-node beam, weights, moments, springs of joints.

`linear` is a frame program's one step, so it must agree with them to rounding: nodes lie at 0.5 m and move by
1e-6 m or more, so 1e-9 of the displacement is 1e-15 m, five units of rounding of a coordinate.
"""

from __future__ import annotations

import numpy as np
import pytest

from pkmcal_cli.base.rotation import Array, exp
from pkmcal_cli.prediction import Request
from tests import structures, verification
from tests.structures import PLANAR_FRAME, cantilever, point
from tests.support import displacement

LINEAR = Request(method="linear")
SI = "units: {length: m, angle: rad, force: N}"
PROBE = (
    "{kind: tcp, at: %s, reads: [x, y, z, rx, ry, rz], sigma: {position: 1 um, orientation: 1 urad}, frame: machine}"
)
EI, GJ, EA = 1300.0, 900.0, 8e7


@pytest.mark.parametrize("row", verification.frames(), ids=lambda row: row[0])
def test_frames_of_independent_programs(row: verification.Row) -> None:
    assert row.measured < 1e-9


def test_exact_differs_from_the_linear_frame_by_second_order() -> None:
    """Displacements of 4e-6 m in rods of 0.3 m: relative difference of the order 1e-5, not 0."""
    linear, exact = (displacement(PLANAR_FRAME, Request(method=m)) for m in ("linear", "exact"))
    assert 1e-9 < np.abs(exact / linear - 1).max() < 1e-4


def test_rods_pinned_at_both_ends_need_no_bending() -> None:
    """The planar frame again, its beams replaced by bars with the same ES/L and half their mass at each end."""
    head, _, rest = PLANAR_FRAME.partition("materials:")
    bars = """bars:
      "rod{i}": {each: {i: [1, 2, 3], l: [300, 300, 600]}, between: ["E{i}", T], length: "{l}",
                 EA: 210000*400, mass: "7.85e-6*400*{l}"}"""
    found = displacement(f"{head}{bars}\n    joints:{rest.partition('joints:')[2]}", LINEAR)
    expected = 1e-3 * np.array(structures.REFERENCE["planar_three_rods"]["displacement_of_T"])
    assert np.abs(found / expected - 1).max() < 1e-9


@pytest.mark.parametrize("pieces", [1, 3])
@pytest.mark.parametrize("turn", [None, exp(np.array([0.4, -1.0, 0.7]))], ids=["plane", "space"])
def test_cantilever_under_a_small_load(pieces: int, turn: Array | None) -> None:
    """Cubic beams are exact at their nodes for loads at nodes: F L^3 / 3 EI and F L^2 / 2 EI."""
    found = displacement(cantilever(pieces, (200.0, 0.3, 0.0), turn, EI, EA, GJ), LINEAR)
    expected = np.array([200.0 / EA, 0.1 / EI, 0, 0, 0, 0.15 / EI])
    if turn is None:
        expected = expected[[0, 1, 5]]
    else:
        expected = np.concatenate([turn @ expected[:3], turn @ expected[3:]])
    assert np.abs(found - expected).max() < 1e-9 * np.abs(expected).max()


@pytest.mark.parametrize(("ends", "divisor"), [("[revolute, fixed]", 48), ("[fixed, fixed]", 192)])
def test_beams_on_two_supports(ends: str, divisor: int) -> None:
    """F L^3 / 48 EI on hinges, F L^3 / 192 EI clamped; two beams that meet at the middle, unevenly divided."""
    text = f"""
    {SI}
    space: planar
    nodes: {{a: {{at: [0, 0], fixed: true}}, m: [0.5, 0], b: {{at: [1, 0], fixed: true}}}}
    beams:
      left: {{between: [a, m], ends: {ends}, EA: {EA}, EI: {EI}, pieces: 3}}
      right: {{between: [b, m], ends: {ends}, EA: {EA}, EI: {EI}}}
    loads: {{push: {{at: m, force: [0, -10]}}}}
    sensors: {{probe: {{kind: tcp, at: m, reads: [x, y], sigma: 1 um, frame: machine}}}}
    """
    assert displacement(text, LINEAR)[1] == pytest.approx(-10 / (divisor * EI), rel=1e-9)


def test_bending_axes_and_torsion_of_sections() -> None:
    """`up` puts z, EIy bends in the plane of up; a rectangle is b along y and h along z; a tube twists by 2 I."""
    e, g, b, h, d, i = 2e11, 8e10, 0.01, 0.03, 0.03, 0.02
    text = f"""
    {SI}
    space: spatial
    nodes: {{a: {{at: [0, 0, 0], fixed: true}}, t: [1, 0, 0], o: {{at: [0, 1, 0], fixed: true}}, s: [1, 1, 0]}}
    materials: {{steel: {{E: {e}, G: {g}}}}}
    sections: {{flat: {{rectangle: [{b}, {h}]}}, pipe: {{tube: [{d}, {i}]}}}}
    beams:
      flat: {{between: [a, t], section: flat, material: steel, up: [0, 1, 0]}}
      pipe: {{between: [o, s], section: pipe, material: steel}}
    loads: {{push: {{at: t, force: [0, 1, 1]}}, twist: {{at: s, moment: [1, 0, 0]}}}}
    sensors: {{p: {PROBE % "t"}, s: {PROBE % "s"}}}
    """
    found = displacement(text, LINEAR)
    assert found[1] == pytest.approx(1 / (3 * e * b * h**3 / 12), rel=1e-9)
    assert found[2] == pytest.approx(1 / (3 * e * h * b**3 / 12), rel=1e-9)
    assert found[9] == pytest.approx(1 / (g * np.pi / 32 * (d**4 - i**4)), rel=1e-9)


@pytest.mark.parametrize("load", ["[0, 3]", "[5, 2]"])
def test_guide_stiffness_is_the_papers_one_node_beam(load: str) -> None:
    """Eq. 3 and 8: Kc with its coupling of lateral motion and tilt as a guide's stiffness is the beam itself."""
    length = 0.4
    kc = f"y: {12 * EI / length**3}, rz: {4 * EI / length}, y_rz: {-6 * EI / length**2}"
    tail = f"""
    loads: {{push: {{at: P, force: {load}}}, twist: {{at: %s, moment: 0.7}}}}
    sensors: {{probe: {{kind: tcp, at: P, reads: [x, y, rz], frame: machine,
      sigma: {{position: 1 um, orientation: 1 urad}}}}}}
    """
    guided = f"""
    {SI}
    space: planar
    guides: {{rail: {{along: x, stiffness: {{{kc}}}}}}}
    bodies: {{car: {{guide: rail, at: {length}, points: {{P: [0.1, 0.05]}}}}}}
    actuators: {{q: {{moves: car, stiffness: {EA / length}}}}}
    {tail % "car"}
    """
    beam = f"""
    {SI}
    space: planar
    nodes: {{root: {{at: [0, 0], fixed: true}}, tip: [{length}, 0]}}
    bodies: {{car: {{at: [{length}, 0], points: {{C: [0, 0], P: [0.1, 0.05]}}}}}}
    joints: {{weld: {{between: [tip, C], type: fixed}}}}
    beams: {{beam: {{between: [root, tip], EA: {EA}, EI: {EI}}}}}
    {tail % "car"}
    """
    one, other = displacement(guided, LINEAR, [[length]]), displacement(beam, LINEAR)
    assert np.abs(one - other).max() < 1e-9 * np.abs(other).max()


def test_guide_stiffness_in_space_has_the_reversed_sign_about_y() -> None:
    """Eq. 17: bending with Iy couples z and ry with the signs reversed."""
    length = 0.4
    lateral, tilt, mixed = 12 * EI / length**3, 4 * EI / length, 6 * EI / length**2
    kc = f"y: {lateral}, z: {lateral}, rx: {GJ / length}, ry: {tilt}, rz: {tilt}, y_rz: {-mixed}, z_ry: {mixed}"
    load = "loads: {push: {at: %s, force: [10, 2, -3], moment: [0.5, -0.4, 0.3]}}"
    guided = f"""
    {SI}
    space: spatial
    guides: {{rail: {{along: x, stiffness: {{{kc}}}}}}}
    bodies: {{car: {{guide: rail, at: {length}}}}}
    actuators: {{q: {{moves: car, stiffness: {EA / length}}}}}
    {load % "car"}
    sensors: {{probe: {PROBE % "car"}}}
    """
    beam = f"""
    {SI}
    space: spatial
    nodes: {{root: {{at: [0, 0, 0], fixed: true}}, tip: [{length}, 0, 0]}}
    beams: {{beam: {{between: [root, tip], EA: {EA}, EI: {EI}, GJ: {GJ}}}}}
    {load % "tip"}
    sensors: {{probe: {PROBE % "tip"}}}
    """
    one, other = displacement(guided, LINEAR, [[length]]), displacement(beam, LINEAR)
    assert np.abs(one - other).max() < 1e-9 * np.abs(other).max()


def weighted(pieces: int, more: str = "") -> str:
    """A horizontal beam of 1 m and 2 kg under its own weight."""
    text = cantilever(pieces, (0, 0, 0), None, EI, EA, more=", mass: 2")
    return text.replace("space: planar", f"space: planar\n    gravity: [0, -9.81]\n    {more}")


def test_own_weight_is_lumped_half_and_half() -> None:
    """One piece: half the weight at the tip. Many: q L^4 / 8 EI, the error of the lumps falling as h^2."""
    weight = 2 * 9.81
    assert displacement(weighted(1), LINEAR)[1] == pytest.approx(-weight / 2 / (3 * EI), rel=1e-9)
    closed = -weight / (8 * EI)
    errors = [abs(displacement(weighted(n), LINEAR)[1] / closed - 1) for n in (4, 8)]
    assert errors[0] / errors[1] == pytest.approx(4, rel=1e-3)
    assert np.abs(displacement(weighted(1, "own_weight: false"), LINEAR)).max() == 0.0


def hinged(kind: str, springs: str, load: str, axis: str = "") -> str:
    """A body joined to the base in one point."""
    return f"""
    {SI}
    space: spatial
    ground: {{A: [0.1, 0.2, 0.3]}}
    bodies: {{disc: {{at: [0.1, 0.2, 0.3]}}}}
    joints: {{hub: {{between: [A, disc], type: {kind}, {axis}stiffness: {{{springs}}}}}}}
    loads: {{push: {{at: disc, {load}}}}}
    sensors: {{probe: {PROBE % "disc"}}}
    """


SKEW = np.array([0.0, 0.6, 0.8])
ABOUT = f"axis: {point(SKEW)}, "


def test_torsion_spring_of_a_revolute_joint_feels_the_moment_about_its_axis() -> None:
    """An ideal hinge turns about one axis: the other components of the moment go to the base."""
    found = displacement(hinged("revolute", "rz: 100", "moment: [0.01, 0.02, 0.03]", ABOUT), LINEAR)
    expected = np.array([0.01, 0.02, 0.03]) @ SKEW / 100 * SKEW
    assert np.abs(found - np.concatenate([np.zeros(3), expected])).max() < 1e-15


def test_spring_along_a_prismatic_joint() -> None:
    found = displacement(hinged("prismatic", "x: 100", "force: [0.01, 0.02, 0.03]", ABOUT), LINEAR)
    expected = np.array([0.01, 0.02, 0.03]) @ SKEW / 100 * SKEW
    assert np.abs(found - np.concatenate([expected, np.zeros(3)])).max() < 1e-15


def test_six_springs_of_a_fixed_joint() -> None:
    springs = "x: 100, y: 200, z: 300, rx: 10, ry: 20, rz: 30"
    load = "force: [0.01, 0.02, 0.03], moment: [0.001, 0.002, 0.003]"
    found = displacement(hinged("fixed", springs, load), LINEAR)
    assert np.abs(found - 1e-4).max() < 1e-15


def test_a_moment_on_a_carriage_without_tilt_goes_to_the_base() -> None:
    text = f"""
    {SI}
    space: planar
    guides: {{rail: {{along: x}}}}
    bodies: {{car: {{guide: rail, at: 0.2}}}}
    nodes: {{tip: [1.2, 0]}}
    bars: {{rod: {{between: [car, tip], EA: {EA}}}, stay: {{between: [top, tip], EA: {EA}}}}}
    ground: {{top: [0.2, 1]}}
    actuators: {{q: {{moves: car}}}}
    loads: {{twist: {{at: car, moment: 50}}}}
    sensors: {{probe: {{kind: tcp, at: tip, reads: [x, y], sigma: 1 um, frame: machine}}}}
    """
    assert np.abs(displacement(text, LINEAR, [[0.2]])).max() < 1e-15
