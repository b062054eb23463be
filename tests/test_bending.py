"""Beams that bend: the elastica, patches, reciprocity, and the same structure in other places.

Rounding of a beam of 1 m of 32 pieces with EI/h^3 up to 3e4: about 1e-12 m in its tip.
"""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest

from pkmcal_cli.base.rotation import Array, exp
from pkmcal_cli.prediction import Request
from tests.measured import elastica_error
from tests.structures import cantilever, point
from tests.support import at, displacement, model
from tests.truth import beam_chain
from tests.truth.beam_chain import Section
from tests.truth.test_truth_bending import elastica

TURN = exp(np.array([0.5, -1.0, 0.7]))
LINEAR = Request(method="linear")
IN_SPACE = pytest.mark.parametrize("turn", [None, TURN], ids=["plane", "space"])


@IN_SPACE
def test_elastica_with_32_pieces(turn: Array | None) -> None:
    assert elastica_error(32, turn) < 1e-3


@IN_SPACE
def test_error_of_the_elastica_falls_as_the_square_of_the_pieces(turn: Array | None) -> None:
    errors = [elastica_error(n, turn) for n in (8, 16, 32)]
    assert errors[0] / errors[1] == pytest.approx(4, rel=0.03)  # next order: (1/8)^2
    assert errors[1] / errors[2] == pytest.approx(4, rel=0.01)


@pytest.mark.parametrize("pieces", [8, 64])
def test_a_slender_beam_that_stretches_bends_as_the_elastica(pieces: int) -> None:
    """E S L^2 / E I = 2e6, as of a strip 2.4 mm thick: stiff along, soft across, where Newton's steps rebound."""
    back, over = elastica(5.0)
    found = displacement(cantilever(pieces, (0, 5, 0), TURN, ea=2e6))
    tip = TURN.T @ found[:3]
    assert np.hypot(tip[0] + back, tip[1] - over) / over == pytest.approx(elastica_error(pieces), abs=1e-5)


def test_plane_and_space_are_one_structure() -> None:
    """The tip of the elastica in the plane and turned in space, to rounding."""
    plane = displacement(cantilever(16, (0, 5, 0)))
    space = displacement(cantilever(16, (0, 5, 0), TURN))
    assert np.abs(TURN.T @ space[:3] - [*plane[:2], 0]).max() < 1e-12
    assert np.abs(TURN.T @ space[3:] - [0, 0, plane[2]]).max() < 1e-11


def test_small_load_gives_the_closed_form() -> None:
    """F L^3 / 3 EI; the shortening of the chord is of second order, 1e-8 of the load's square."""
    for load in (1e-3, 1e-5):
        found = displacement(cantilever(4, (0, load, 0)))
        assert found[1] == pytest.approx(load / 3, rel=max(load**2, 1e-10))
        assert found[2] == pytest.approx(load / 2, rel=max(load**2, 1e-10))


def test_large_bending_with_stretch_against_a_chain_of_rigid_pieces() -> None:
    """A skew load on a beam that stretches by 2 %, both extrapolated to h = 0.

    The chain's hinges lie before its slides, so its error has a term in h besides the one in h^2.
    """
    force, section = (2.0, 3.0, 4.0), Section(200.0, 1.0, 1.0, 0.0)
    chain = [np.array(beam_chain.cantilever(1.0, section, n, force)[0], float) for n in (32, 64, 128)]
    chain = [2 * fine - coarse for coarse, fine in pairwise(chain)]
    beam = [displacement(cantilever(n, force, np.eye(3), ea=200.0))[:3] for n in (16, 32)]
    limits = [(4 * fine - coarse) / 3 for coarse, fine in (chain, beam)]
    assert np.abs(limits[0] - [1, 0, 0] - limits[1]).max() < 2e-6


def test_pure_bending_rolls_the_beam_into_an_arc() -> None:
    """A moment M at the tip: bending angles sin(a / 2) at both ends of a piece give M = EI / h sin a, a = M h / EI."""
    for pieces, moment in ((1, 0.5), (8, 2.0)):
        text = cantilever(pieces, (0, 0, 0)).replace("force: [0.0, 0.0]", f"moment: {moment}")
        assert displacement(text)[2] == pytest.approx(pieces * np.arcsin(moment / pieces), rel=1e-10)


PATCH = """
units: {{length: m, angle: rad, force: N}}
space: spatial
nodes: {{a: {{at: {0}, fixed: true}}, b: {1}, c: {2}, d: {3}}}
beams: {{"p{{i}}": {{each: {{i: [a, b, c], j: [b, c, d]}}, between: ["{{i}}", "{{j}}"], EA: 1e6, EI: 200, GJ: 150}}}}
loads: {{end: {{at: d, force: {4}, moment: {5}}}}}
sensors: {{"at_{{i}}": {{each: {{i: [b, c, d]}}, kind: tcp, at: "{{i}}", reads: [x, y, z, rx, ry, rz],
  sigma: {{position: 1 um, orientation: 1 urad}}, frame: machine}}}}
"""


@pytest.mark.parametrize("turn", [np.eye(3), TURN], ids=["along x", "turned"])
def test_patch_of_uneven_beams(turn: Array) -> None:
    """Stretch, twist, bending and shear force in beams of 0.1, 0.25 and 0.65 m: exact at every node."""
    force, moment = np.array([50.0, 0.2, -0.3]), np.array([0.4, 0.1, 0.2])
    stations = (0.0, 0.1, 0.35, 1.0)
    places = [point(turn @ [x, 0, 0]) for x in stations]
    text = PATCH.format(*places, point(turn @ force), point(turn @ moment))
    found = displacement(text, LINEAR).reshape(3, 2, 3)
    for (place, angle), x in zip(found, stations[1:], strict=True):
        # moments at x: M + F (1 - x); integrate once and twice
        slope = [moment[k] * x + s * force[3 - k] * (x - x**2 / 2) for k, s in ((1, -1), (2, 1))]
        shape = [moment[k] * x**2 / 2 + s * force[3 - k] * (x**2 / 2 - x**3 / 6) for k, s in ((1, -1), (2, 1))]
        expected = [50.0 * x / 1e6, shape[1] / 200, -shape[0] / 200]
        turned = [moment[0] * x / 150, slope[0] / 200, slope[1] / 200]
        assert np.abs(turn.T @ place - expected).max() < 1e-12
        assert np.abs(turn.T @ angle - turned).max() < 1e-12


BENT = """
units: {{length: m, angle: rad, force: N}}
space: spatial
gravity: {gravity}
ranges: {{force: 1}}
parameters: {{F1: {{nominal: {push}, unit: N}}, F2: {{nominal: 0, unit: N}}}}
ground: {{A: {A}, B: {B}, C: {C}}}
nodes: {{m: {m}, n: {n}}}
bodies:
  plate: {{at: {plate}, turn: {turn}, mass: 3, points: {{P: [0.2, 0, 0.1], Q: [-0.1, 0.2, 0], R: [0, -0.2, 0]}}}}
sections: {{strut: {{round: 0.02}}}}
materials: {{steel: {{E: 2e11, density: 7850}}}}
beams:
  low: {{between: [A, m], ends: [{{joint: universal, axes: [{x}, {y}]}}, fixed], section: strut, material: steel}}
  high: {{between: [n, P], ends: [fixed, spherical], section: strut, material: steel, pieces: 2}}
  arm: {{between: [B, Q], section: strut, material: steel, pieces: 2}}
bars: {{rod: {{between: [C, R], EA: 2e6}}}}
joints: {{slide: {{between: [m, n], type: prismatic}}}}
actuators: {{q: {{drives: slide, stiffness: 1e6}}}}
loads:
  one: {{at: P, force: ["{f1[0]}*F1", "{f1[1]}*F1", "{f1[2]}*F1"]}}
  two: {{at: R, force: ["{f2[0]}*F2", "{f2[1]}*F2", "{f2[2]}*F2"]}}
sensors:
  p: {{kind: tcp, at: P, reads: [x, y, z], sigma: 1 um, frame: machine}}
  r: {{kind: tcp, at: R, reads: [x, y, z], sigma: 1 um, frame: machine}}
"""
WAYS = np.array([[0.6, 0.0, 0.8], [0.0, -0.8, 0.6]])


def bent(turn: Array, shift: Array, push: float) -> str:
    """A plate on a telescopic leg, a bending arm and a rod, turned and moved as a whole; two forces F1 and F2."""
    places = {
        "A": [0.5, 0, 0],
        "B": [-0.6, 0.6, 0.1],
        "C": [0, -0.7, 0.2],
        "m": [0.38, 0, 0.22],
        "n": [0.32, 0, 0.33],
        "plate": [0, 0, 0.45],
    }
    ways = {"gravity": [0, 0, -9.81], "x": [0, 1, 0], "y": [0.0, 0, 1.0]}
    vector = turn_vector(turn)
    return BENT.format(
        **{name: point(shift + turn @ place) for name, place in places.items()},
        **{name: point(turn @ way) for name, way in ways.items()},
        turn=point(vector),
        push=push,
        f1=(turn @ WAYS[0]).tolist(),
        f2=(turn @ WAYS[1]).tolist(),
    )


def turn_vector(turn: Array) -> Array:
    """Rotation vector (3,) by scipy, which the engine does not use."""
    from scipy.spatial.transform import Rotation

    out: Array = Rotation.from_matrix(turn).as_rotvec()
    return out


@pytest.mark.parametrize("push", [0.0, 2000.0])
def test_maxwell_betti(push: float) -> None:
    """What a force at R moves P along F1 is what that force at P moves R along F2, at a strained pose too.

    By the exact derivatives with respect to the forces, so to rounding of a solve (condition about 1e6).
    """
    machine = model(bent(np.eye(3), np.zeros(3), push))
    readings = machine.reference_readings + 0.002
    jacobian = at(machine, readings, Request(parameters=("F1", "F2"))).jacobian[0]
    crossed = WAYS[0] @ jacobian[:3, 1], WAYS[1] @ jacobian[3:, 0]
    assert crossed[0] == pytest.approx(crossed[1], rel=1e-9)
    assert abs(crossed[0]) > 1e-3 * np.abs(jacobian).max()


@pytest.mark.parametrize("method", ["exact", "linear", "rigid"])
def test_frame_indifference(method: str) -> None:
    """The whole machine, its loads and its weight turned and moved: same energy and force, places turned along."""
    shift, request = np.array([3.0, -2.0, 1.0]), Request(method=method, forces=True)
    machines = model(bent(np.eye(3), np.zeros(3), 500.0)), model(bent(TURN, shift, 500.0))
    here, there = (at(m, m.reference_readings + 0.002, request) for m in machines)
    expected = shift + here.values.reshape(2, 3) @ TURN.T
    assert np.abs(there.values.reshape(2, 3) - expected).max() < 1e-12
    if method == "exact":
        assert here.energy[0] > 0.1
    assert there.energy[0] == pytest.approx(here.energy[0], rel=1e-8, abs=1e-20)
    assert there.forces[0, 0] == pytest.approx(here.forces[0, 0], rel=1e-8, abs=1e-6)
