"""Contract of the element family: whatever pkmcal_cli.elements holds, by closed forms and by complex steps.

Complex steps are exact to rounding, so tolerances are a few hundred units of rounding of the terms.
"""

from __future__ import annotations

import importlib
import itertools
import pkgutil
from dataclasses import dataclass, replace

import numpy as np
import pytest

import pkmcal_cli.elements as family
from pkmcal_cli.base.rotation import Array, exp, skew
from pkmcal_cli.elements import (
    JOINTS,
    BarElement,
    BeamElement,
    Element,
    JointElement,
    LinkGeometry,
    LoadElement,
    OrientationElement,
    PlanarPulleyElement,
    SwivelPulleyElement,
)
from pkmcal_cli.elements.element import THETA_I, THETA_J

STEP = 1e-30
ALL = ("x", "y", "z", "rx", "ry", "rz")
SPACE = {"x": 0, "y": 1, "z": 2, "rx": 3, "ry": 4, "rz": 5}


@dataclass(frozen=True)
class Sample:
    """An element and a state without strain: chord (3,) in m at triads I, rest values (m,); sizes (p,)."""

    name: str
    element: Element
    chord: tuple[float, float, float]
    rest: tuple[float, ...]
    sizes: tuple[float, ...] = ()


def joint_directions(kind: str) -> tuple[str, ...]:
    """All that a joint of this type can hold: blocked directions and its drive or torsion spring."""
    drive = JOINTS[kind].drive
    return (*JOINTS[kind].blocked, *(["angle" if drive == "rz" else drive] if drive else []))


def samples() -> list[Sample]:
    out = [
        Sample("bar", BarElement(), (0.3, 0.0, 0.0), (0.3,)),
        Sample("beam", BeamElement(), (0.3, 0.0, 0.0), (0.3, 0, 0, 0, 0, 0)),
        Sample("planar beam", BeamElement(planar=True), (0.3, 0.0, 0.0), (0.3, 0, 0)),
        Sample("guide", JointElement("fixed", ("x", "y", "z")), (0.0, 0.0, 0.0), (0, 0, 0)),
        Sample("orientation", OrientationElement(("rx", "ry", "rz")), (0.0, 0.0, 0.0), (0, 0, 0)),
        Sample("part of an orientation", OrientationElement(("rz",)), (0.0, 0.0, 0.0), (0,)),
    ]
    for kind in JOINTS:
        rows = joint_directions(kind)
        out.append(Sample(kind, JointElement(kind, rows), (0.0, 0.0, 0.0), (0.0,) * len(rows)))
    return out


SAMPLES = samples()
LOADED = [*SAMPLES, Sample("load", LoadElement(), (0.1, 0.2, 0.3), (0.1, 0.2, 0.3))]
PULLEYS = [
    Sample("planar pulleys", PlanarPulleyElement(), (0.3, 0.0, 0.0), (0.3,), (0.012, -0.02, 0.7, 1.1)),
    Sample("planar pulleys on one side", PlanarPulleyElement(), (0.3, 0.0, 0.0), (0.3,), (-0.02, -0.01, -2.0, 0.3)),
    Sample("pulley that swivels", SwivelPulleyElement(), (0.2, 0.1, 0.2), (0.3,), (0.02,)),
    Sample("straight rope", SwivelPulleyElement(), (0.0, 0.0, 0.3), (0.3,), (0.0,)),
]
"""Links of ropes, whose strain alone may change under a rigid motion in the plane: only their sum does not."""
by_name = pytest.mark.parametrize("sample", SAMPLES, ids=lambda s: s.name)
with_loads = pytest.mark.parametrize("sample", [*LOADED, *PULLEYS], ids=lambda s: s.name)


def turn(rng: np.random.Generator, size: float = 1.0) -> Array:
    return exp(size * rng.normal(size=3))


def link_of(sample: Sample, chord: Array, ti: Array, tj: Array) -> LinkGeometry:
    """What one element sees."""
    return LinkGeometry(chord[None, None], ti[None, None], tj[None, None], np.array(sample.sizes)[None, None])


def evaluate(sample: Sample, chord: Array, ti: Array, tj: Array) -> tuple[Array, Array]:
    """Strains (m,) and gradient (m, inputs) of one element."""
    rest = np.array(sample.rest, dtype=float)[None, None]
    e, b = sample.element.evaluate(link_of(sample, chord, ti, tj), rest)
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
    assert set(Element.__subclasses__()) == {type(s.element) for s in (*LOADED, *PULLEYS)}


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
        found = sample.element.curvature(link_of(sample, *state), stress[None, None])[0, 0]
        for k in range(width):
            _, b = evaluate(sample, *stepped(state, np.eye(9)[k]))
            # entries go up to stress / length^2, about 1e2
            assert np.abs((stress @ b).imag / STEP - found[:, k]).max() < 1e-12


@pytest.mark.parametrize("sample", PULLEYS, ids=lambda s: s.name)
def test_sizes_move_the_strain_by_their_derivative(sample: Sample) -> None:
    rng = np.random.default_rng(8)
    for _ in range(5):
        state = strained(sample, rng)
        found = sample.element.by_sizes(link_of(sample, *state))[0, 0]
        for k, unit in enumerate(np.eye(len(sample.sizes))):
            stepped_sizes = replace(sample, sizes=tuple(np.array(sample.sizes) + 1j * STEP * unit))
            e, _ = evaluate(stepped_sizes, *state)
            assert np.abs(e.imag / STEP - found[:, k]).max() < 1e-14


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
    element = JointElement(kind, JOINTS[kind].blocked)
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
    _, b = evaluate(Sample(kind, JointElement(kind, rows), (0, 0, 0), (0.0,) * len(rows)), *rest)
    relative = np.hstack([b[:, :3], b[:, THETA_J]])
    own = [SPACE["rz" if d == "angle" else d] for d in rows]
    assert np.array_equal(relative, np.eye(6)[own])
    assert np.array_equal(b[:, THETA_I], -b[:, THETA_J])


@pytest.mark.parametrize("angle", [0.3, 2.0, -3.0])
def test_drive_angle_is_the_angle_about_the_axis(angle: float) -> None:
    q = turn(np.random.default_rng(7))
    for whole in (0, 3):  # a drive that has made whole turns
        rest = angle + 2 * np.pi * whole
        crank = Sample("crank", JointElement("revolute", ("angle",)), (0, 0, 0), (rest,))
        e, _ = evaluate(crank, np.zeros(3), q, q @ exp(np.array([0, 0, angle + 0.01])))
        assert e[0] == pytest.approx(0.01, abs=1e-14)


def test_joint_couplings_fill_a_symmetric_block() -> None:
    """The paper's Kc couples lateral motion and tilt (eq. 3): the diagonal, then pairs in order."""
    directions = ("x", "y", "rz")
    patterns = JointElement("fixed", directions).patterns
    block = np.array([[5.0, 1.0, 2.0], [1.0, 6.0, 3.0], [2.0, 3.0, 7.0]])
    pairs = [block[k, l] for k, l in itertools.combinations(range(3), 2)]
    assert np.array_equal(np.tensordot([5.0, 6.0, 7.0, *pairs], patterns, 1), block)
