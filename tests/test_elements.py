"""Contract of the element family: whatever pkmcal_cli.elements holds, by closed forms and by complex steps.

Complex steps are exact to rounding, so tolerances are a few hundred units of rounding of the terms.
"""

from __future__ import annotations

import importlib
import itertools
import pkgutil
from dataclasses import dataclass

import numpy as np
import pytest

import pkmcal_cli.elements as family
from pkmcal_cli.base.rotation import Array, exp, skew
from pkmcal_cli.elements import JOINTS, Bar, Beam, Element, Joint, Load
from pkmcal_cli.elements.base import THETA_I, THETA_J

STEP = 1e-30
ALL = ("x", "y", "z", "rx", "ry", "rz")
SPACE = {"x": 0, "y": 1, "z": 2, "rx": 3, "ry": 4, "rz": 5}


@dataclass(frozen=True)
class Sample:
    """An element and a state without strain: chord (3,) in m at triads I, rest values (m,)."""

    name: str
    element: Element
    chord: tuple[float, float, float]
    rest: tuple[float, ...]


def joint_directions(kind: str) -> tuple[str, ...]:
    """All that a joint of this type can hold: blocked directions and its drive or torsion spring."""
    drive = JOINTS[kind].drive
    return (*JOINTS[kind].blocked, *(["angle" if drive == "rz" else drive] if drive else []))


def samples() -> list[Sample]:
    out = [
        Sample("bar", Bar(), (0.3, 0.0, 0.0), (0.3,)),
        Sample("beam", Beam(), (0.3, 0.0, 0.0), (0.3, 0, 0, 0, 0, 0)),
        Sample("planar beam", Beam(planar=True), (0.3, 0.0, 0.0), (0.3, 0, 0)),
        Sample("guide", Joint("fixed", ("x", "y", "z")), (0.0, 0.0, 0.0), (0, 0, 0)),
    ]
    for kind in JOINTS:
        rows = joint_directions(kind)
        out.append(Sample(kind, Joint(kind, rows), (0.0, 0.0, 0.0), (0.0,) * len(rows)))
    return out


SAMPLES = samples()
LOADED = [*SAMPLES, Sample("load", Load(), (0.1, 0.2, 0.3), (0.1, 0.2, 0.3))]
by_name = pytest.mark.parametrize("sample", SAMPLES, ids=lambda s: s.name)
with_loads = pytest.mark.parametrize("sample", LOADED, ids=lambda s: s.name)


def turn(rng: np.random.Generator, size: float = 1.0) -> Array:
    return exp(size * rng.normal(size=3))


def evaluate(sample: Sample, chord: Array, ti: Array, tj: Array) -> tuple[Array, Array]:
    """Strains (m,) and gradient (m, inputs) of one element."""
    e, b = sample.element.evaluate(
        chord[None, None], ti[None, None], tj[None, None], np.array(sample.rest, dtype=float)[None, None]
    )
    return e[0, 0], b[0, 0]


def strained(sample: Sample, rng: np.random.Generator) -> tuple[Array, Array, Array]:
    """A random state with strains of the order of 0.1, in a random position."""
    q = turn(rng)
    chord = q @ (np.array(sample.chord) + 0.05 * rng.normal(size=3))
    return chord, turn(rng, 0.1) @ q, turn(rng, 0.1) @ q


def stepped(state: tuple[Array, Array, Array], way: Array) -> tuple[Array, Array, Array]:
    """The state moved by an infinitesimal imaginary step along the nine inputs."""
    chord, ti, tj = state
    step = 1j * STEP * way
    return chord + step[:3], ti + skew(step[THETA_I]) @ ti, tj + skew(step[THETA_J]) @ tj


def test_every_element_of_the_family_is_sampled() -> None:
    for module in pkgutil.iter_modules(family.__path__):
        importlib.import_module(f"{family.__name__}.{module.name}")
    assert set(Element.__subclasses__()) == {type(s.element) for s in LOADED}


@by_name
def test_no_strain_under_any_rigid_motion(sample: Sample) -> None:
    rng = np.random.default_rng(1)
    for _ in range(20):
        q = turn(rng)
        e, _ = evaluate(sample, q @ np.array(sample.chord), q, q)
        assert np.abs(e).max() < 1e-15  # exact: rounding of the rotation only


@by_name
def test_rigid_motions_are_in_the_null_space_of_the_gradient(sample: Sample) -> None:
    """A small turn of everything, at a strained state: delta moves by w x delta, both triads by w."""
    rng = np.random.default_rng(2)
    chord, ti, tj = strained(sample, rng)
    _, b = evaluate(sample, chord, ti, tj)
    motion = np.vstack([-skew(chord), np.eye(3), np.eye(3)])[: b.shape[1]]
    if b.shape[1] == 3:
        motion = -skew(chord)
    assert np.abs(b @ motion).max() < 1e-15


@with_loads
def test_gradient_is_the_derivative_of_the_strains(sample: Sample) -> None:
    rng = np.random.default_rng(3)
    for _ in range(5):
        state = strained(sample, rng)
        _, b = evaluate(sample, *state)
        for k in range(sample.element.inputs):
            e, _ = evaluate(sample, *stepped(state, np.eye(9)[k]))
            assert np.abs(e.imag / STEP - b[:, k]).max() < 1e-14


@with_loads
def test_curvature_is_the_derivative_of_the_force(sample: Sample) -> None:
    rng = np.random.default_rng(4)
    width = sample.element.inputs
    for _ in range(5):
        state = strained(sample, rng)
        stress = rng.normal(size=len(sample.rest))
        chord, ti, tj = (part[None, None] for part in state)
        found = sample.element.curvature(chord, ti, tj, stress[None, None])[0, 0]
        for k in range(width):
            _, b = evaluate(sample, *stepped(state, np.eye(9)[k]))
            # entries go up to stress / length^2, about 1e2
            assert np.abs((stress @ b).imag / STEP - found[:, k]).max() < 1e-12


@by_name
def test_stiffness_is_symmetric_and_not_negative(sample: Sample) -> None:
    """For every pattern of stiffness without couplings, and K = B^T S B in a random state."""
    rng = np.random.default_rng(5)
    patterns = sample.element.patterns
    own = [p for p in range(len(patterns)) if np.trace(patterns[p]) > 0]
    numbers = np.zeros(len(patterns))
    numbers[own] = rng.uniform(1, 2, len(own))
    stiffness = np.tensordot(numbers, patterns, 1)
    assert np.array_equal(stiffness, stiffness.T)
    assert np.linalg.eigvalsh(stiffness).min() > 0
    _, b = evaluate(sample, *strained(sample, rng))
    k = b.T @ stiffness @ b
    assert np.linalg.eigvalsh(k).min() > -1e-12 * np.abs(k).max()


def free_motions(kind: str, rng: np.random.Generator) -> tuple[Array, Array]:
    """A finite free motion of a joint of triads I: displacement of j, and triad of j."""
    z = exp(np.array([0.0, 0.0, rng.uniform(-3, 3)]))
    slide = rng.normal(size=3)
    first, second = exp(np.array([rng.uniform(-3, 3), 0, 0])), exp(np.array([0, rng.uniform(-3, 3), 0]))
    return {
        "fixed": (np.zeros(3), np.eye(3)),
        "prismatic": (slide * [1, 0, 0], np.eye(3)),
        "revolute": (np.zeros(3), z),
        "cylindrical": (slide * [0, 0, 1], z),
        "planar": (slide * [1, 1, 0], z),
        "universal": (np.zeros(3), first @ second),
        "spherical": (np.zeros(3), turn(rng)),
    }[kind]


FREEDOM = {
    "fixed": 0,
    "prismatic": 1,
    "revolute": 1,
    "universal": 2,
    "cylindrical": 2,
    "spherical": 3,
    "planar": 3,
}


@pytest.mark.parametrize("kind", JOINTS)
def test_null_space_of_a_joint_is_its_freedom(kind: str) -> None:
    """At every finite free motion, in every position: no strain, as many free directions as the type says."""
    rng = np.random.default_rng(6)
    element = Joint(kind, JOINTS[kind].blocked)
    sample = Sample(kind, element, (0, 0, 0), (0.0,) * len(element.directions))
    for _ in range(20):
        moved, turned = free_motions(kind, rng)
        q = turn(rng)
        e, b = evaluate(sample, q @ moved, q, q @ turned)
        assert np.abs(e).max() < 1e-14
        relative = np.hstack([b[:, :3], b[:, THETA_J]])  # motion of j with i at rest
        assert 6 - np.linalg.matrix_rank(relative, tol=1e-6) == FREEDOM[kind]


@pytest.mark.parametrize("kind", JOINTS)
def test_small_strains_are_motions_of_j_against_i(kind: str) -> None:
    """At rest each strain is the motion along or about its own axis: S of a fixed joint is Kd of eq. 5."""
    rows = joint_directions(kind)
    rest = np.zeros(3), np.eye(3), np.eye(3)
    _, b = evaluate(Sample(kind, Joint(kind, rows), (0, 0, 0), (0.0,) * len(rows)), *rest)
    relative = np.hstack([b[:, :3], b[:, THETA_J]])
    own = [SPACE["rz" if d == "angle" else d] for d in rows]
    assert np.array_equal(relative, np.eye(6)[own])
    assert np.array_equal(b[:, THETA_I], -b[:, THETA_J])


@pytest.mark.parametrize("angle", [0.3, 2.0, -3.0])
def test_drive_angle_is_the_angle_about_the_axis(angle: float) -> None:
    q = turn(np.random.default_rng(7))
    for whole in (0, 3):  # a drive that has made whole turns
        rest = angle + 2 * np.pi * whole
        crank = Sample("crank", Joint("revolute", ("angle",)), (0, 0, 0), (rest,))
        e, _ = evaluate(crank, np.zeros(3), q, q @ exp(np.array([0, 0, angle + 0.01])))
        assert e[0] == pytest.approx(0.01, abs=1e-14)


def test_joint_couplings_fill_a_symmetric_block() -> None:
    """The paper's Kc couples lateral motion and tilt (eq. 3): the diagonal, then pairs in order."""
    directions = ("x", "y", "rz")
    patterns = Joint("fixed", directions).patterns
    block = np.array([[5.0, 1.0, 2.0], [1.0, 6.0, 3.0], [2.0, 3.0, 7.0]])
    pairs = [block[k, l] for k, l in itertools.combinations(range(3), 2)]
    assert np.array_equal(np.tensordot([5.0, 6.0, 7.0, *pairs], patterns, 1), block)


def beam_matrix(length: float, ea: float, gj: float, eiy: float, eiz: float) -> Array:
    """The 12 x 12 matrix of the books (Ecorchard 2010, eq. 17), DOF (x, y, z, rx, ry, rz) per node."""
    k = np.zeros((12, 12))
    for dofs, stiffness in (((0, 6), ea / length), ((3, 9), gj / length)):
        k[np.ix_(dofs, dofs)] += stiffness * np.array([[1, -1], [-1, 1]])
    plane = np.array(
        [
            [12, 6 * length, -12, 6 * length],
            [6 * length, 4 * length**2, -6 * length, 2 * length**2],
            [-12, -6 * length, 12, -6 * length],
            [6 * length, 2 * length**2, -6 * length, 4 * length**2],
        ]
    )
    signs = np.array([1, -1, 1, -1])  # bending about y: the coupling signs reversed
    k[np.ix_((1, 5, 7, 11), (1, 5, 7, 11))] += eiz / length**3 * plane
    k[np.ix_((2, 4, 8, 10), (2, 4, 8, 10))] += eiy / length**3 * plane * np.outer(signs, signs)
    return k


def node_matrix(element: Beam, length: float, numbers: list[float], position: Array) -> Array:
    """K = B^T S B of a beam at rest in a position (3, 3), by the displacements of its two nodes."""
    sample = Sample("beam", element, (length, 0, 0), (length,) + (0.0,) * (len(element.strains) - 1))
    _, b = evaluate(sample, position @ np.array(sample.chord), position, position)
    inputs = np.zeros((9, 12))
    inputs[:3, :3], inputs[:3, 6:9] = -np.eye(3), np.eye(3)
    inputs[3:6, 3:6] = inputs[6:9, 9:12] = np.eye(3)
    stiffness = np.tensordot(numbers, element.patterns, 1)
    found: Array = inputs.T @ b.T @ stiffness @ b @ inputs
    return found


@pytest.mark.parametrize("seed", range(3))
def test_stiffness_of_the_spatial_beam_is_that_of_the_books(seed: int) -> None:
    rng = np.random.default_rng(seed)
    length, ea, gj, eiy, eiz = 0.7, 8.4e7, 1.1e4, 1.3e3, 2.9e3
    q = np.eye(3) if seed == 0 else turn(rng)
    t = np.kron(np.eye(4), q)  # eq. 6: node displacements of the local frame in base axes
    expected = t @ beam_matrix(length, ea, gj, eiy, eiz) @ t.T
    found = node_matrix(Beam(), length, [ea / length, gj / length, eiy / length, eiz / length], q)
    assert np.abs(found - expected).max() < 1e-14 * np.abs(expected).max()


@pytest.mark.parametrize("angle", [0.0, 0.8, -2.5])
def test_stiffness_of_the_planar_beam_is_the_papers(angle: float) -> None:
    length, ea, ei = 0.7, 8.4e7, 2.9e3
    ka = np.array(
        [
            [ea / length, 0, 0],
            [0, 12 * ei / length**3, 6 * ei / length**2],
            [0, 6 * ei / length**2, 4 * ei / length],
        ]
    )
    kb = np.array(
        [
            [-ea / length, 0, 0],
            [0, -12 * ei / length**3, -6 * ei / length**2],
            [0, 6 * ei / length**2, 2 * ei / length],
        ]
    )
    kc = ka * np.array([[1, 1, 1], [1, 1, -1], [1, -1, 1]])
    q = exp(np.array([0.0, 0.0, angle]))
    planar = [0, 1, 5, 6, 7, 11]
    expected = np.block([[ka, kb.T], [kb, kc]])
    t = np.kron(np.eye(4), q)[np.ix_(planar, planar)]
    found = node_matrix(Beam(planar=True), length, [ea / length, ei / length], q)
    assert np.abs(found[np.ix_(planar, planar)] - t @ expected @ t.T).max() < 1e-14 * np.abs(expected).max()
    across = [2, 3, 4, 8, 9, 10]
    assert np.abs(found[across]).max() == 0.0
