"""The truth of bending beams against itself: closed forms, order of convergence, energy and reciprocity."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest
from scipy.optimize import brentq
from scipy.special import ellipe, ellipeinc, ellipk, ellipkinc

from . import beam_chain
from . import dimensions as dim
from .beam_chain import Section
from .hexapod7 import SECTION, Hexapod7
from .pinned import DeadForce

DRAWN = [[*dim.HEXAPOD7_DRAWN, 0.0, 0.0, 0.0]]
POSE = [[0.05, -0.07, 0.53, 0.1, -0.12, 0.07]]


def planted(machine: Hexapod7) -> dict[str, float]:
    """Parameters with errors, sd = range."""
    draw = np.random.default_rng(11).normal(size=len(machine.nominal))
    return {n: v + d * machine.ranges[n] for (n, v), d in zip(machine.nominal.items(), draw, strict=True)}


def elastica(load: float) -> tuple[float, float]:
    """Tip of an inextensible cantilever of length 1 under a dead force across, load = P L^2 / EI: how far the
    tip draws back and how far it bends over, per length (elliptic integrals; Bisshopp, Drucker 1945)."""

    def start(modulus: float) -> float:
        return float(np.arcsin(1 / (modulus * np.sqrt(2))))

    def excess(modulus: float) -> float:
        return float(ellipk(modulus**2) - ellipkinc(start(modulus), modulus**2) - np.sqrt(load))

    k = brentq(excess, np.sqrt(0.5) + 1e-12, 1 - 1e-12, xtol=1e-15)
    across = 1 - 2 / np.sqrt(load) * (ellipe(k**2) - ellipeinc(start(k), k**2))
    along = np.sqrt(2 * (2 * k**2 - 1) / load)
    return float(1 - along), float(across)


def orders(errors: list[float]) -> list[float]:
    """Observed orders for errors at doubled numbers of pieces."""
    return [float(np.log2(a / b)) for a, b in pairwise(errors)]


def test_small_bending_of_a_cantilever() -> None:
    closed = 0.3**3 / (3 * SECTION.ei)
    errors = [abs(beam_chain.cantilever(0.3, SECTION, n, (0, 1, 0))[0][1] / closed - 1) for n in (4, 8, 16)]
    assert orders(errors) == pytest.approx([2, 2], abs=1e-3)
    assert errors[-1] < 1e-3


def test_large_bending_of_a_cantilever_in_a_skew_plane() -> None:
    back, over = elastica(5.0)
    errors = []
    for pieces in (8, 16, 32, 64):
        tip, _ = beam_chain.cantilever(1.0, Section(1e11, 1.0, 1.0, 0.0), pieces, (0, 3, 4))
        errors.append(float(np.hypot(1 - back - tip[0], over - np.hypot(tip[1], tip[2]))))
        assert tip[1] / tip[2] == pytest.approx(0.75, abs=2 / pieces**2)
    assert orders(errors) == pytest.approx([2, 2, 2], abs=0.1)
    assert errors[2] < 1e-3


def test_stretch_of_a_pulled_beam() -> None:
    tip, energy = beam_chain.cantilever(0.3, SECTION, 4, (1000, 0, 0))
    assert float(tip[0]) == pytest.approx(0.3 + 1000 * 0.3 / SECTION.ea, rel=1e-14)
    assert energy == pytest.approx(1000**2 * 0.3 / SECTION.ea / 2, rel=1e-10)


def test_elastica_of_the_literature() -> None:
    assert elastica(1.0) == pytest.approx((0.05643, 0.30172), abs=5e-6)


def test_hexapod_bends_under_its_weight_as_beams_on_two_supports() -> None:
    machine = Hexapod7(pieces=64)
    q = machine.inverse(DRAWN)[0]
    closed = 0.0
    lower, upper, mass = dim.HEXAPOD7_LOWER, 0.2, SECTION.mass * dim.GRAVITY / 2
    for i in dim.HEXAPOD7_LEGS:
        p = machine.nominal
        way = np.array([p[f"p{i}{a}"] - p[f"b{i}{a}"] for a in "xyz"]) + dim.HEXAPOD7_DRAWN
        whole = float(np.linalg.norm(way))
        level = np.hypot(way[0], way[1]) / whole
        near, far = level * mass * lower, level * mass * upper
        base = (near * (whole - lower) + far * upper) / whole
        top = (near * lower + far * (whole - upper)) / whole
        closed += (base**2 * lower**3 + top**2 * upper**3) / (6 * SECTION.ei)
    assert machine.forward(q).bending[0] == pytest.approx(closed, rel=1e-3)


def test_hexapod_converges_with_the_square_of_the_pieces() -> None:
    p = planted(Hexapod7())
    q = Hexapod7().inverse(POSE)
    found = [Hexapod7(pieces=n).forward(q, p) for n in (2, 4, 8, 16)]
    steps = [b.tcp - a.tcp for a, b in pairwise(found)]
    energies = [float(abs(b.bending[0] - a.bending[0])) for a, b in pairwise(found)]
    assert orders(energies) == pytest.approx([2, 2], abs=0.02)
    assert np.abs(steps[-1]).max() < 1e-13


def test_hexapod_bending_moves_the_tcp() -> None:
    machine, p = Hexapod7(), planted(Hexapod7())
    q = machine.inverse([*DRAWN, *POSE])
    stiff = Section(SECTION.ea, 1e4 * SECTION.ei, 1e4 * SECTION.gj, SECTION.mass)
    for values in (dict(machine.nominal), p):
        bent, straight = machine.forward(q, values), Hexapod7(pieces=8, section=stiff).forward(q, values)
        shift = np.linalg.norm(bent.tcp[:, :3] - straight.tcp[:, :3], axis=1)
        assert (bent.bending > 1e-5).all()
        assert ((shift > 1e-12) & (shift < 1e-10)).all()


def test_hexapod_without_weight_is_a_machine_of_pinned_rods() -> None:
    machine = Hexapod7(gravity=0.0)
    p, q = planted(machine), machine.inverse(POSE)
    rods = machine.pinned_start(q[0], p, {}, [])
    found = machine.forward(q, p)
    assert found.bending[0] == pytest.approx(0, abs=1e-15)
    assert np.abs(found.tcp[0, :3] - rods.state.position).max() < 1e-14
    assert np.abs(machine.forward(q).tcp - POSE).max() < 1e-15


def test_work_of_a_hexapod_drive_is_the_change_of_energy() -> None:
    load = DeadForce(np.array([300.0, -200.0, 500.0]), np.array([0.05, 0.02, -0.1]))
    machine = Hexapod7(pieces=4, gravity=0.0)
    p, q = planted(machine), machine.inverse(POSE)[0]
    force = machine.forward(q, p, loads=[load]).drive_force[0]
    for column in (0, 6):
        values = []
        for step in (1e-6, -1e-6):
            solved = machine.solve(q + step * np.eye(7)[column], p, loads=[load])
            place = solved.state.position + solved.state.rotation @ load.point
            values.append(sum(solved.energy.values()) - float(load.force @ place))
        assert (values[0] - values[1]) / 2e-6 == pytest.approx(force[column], rel=1e-6)


def test_hexapod_drive_held_where_its_force_left_it_gives_the_same_pose() -> None:
    machine = Hexapod7(pieces=8)
    p, q = planted(machine), machine.inverse([*DRAWN, *POSE])
    pushed = machine.forward(q, p, {"q7": 250.0})
    held = machine.forward(pushed.travel, p)
    assert held.drive_force[:, 6] == pytest.approx(250.0, abs=1e-5)
    assert np.abs(held.tcp - pushed.tcp).max() < 1e-13


def test_maxwell_betti_of_the_hexapod() -> None:
    machine = Hexapod7(pieces=8)
    p, q = planted(machine), machine.inverse(POSE)[0]
    points = np.array([[0.1, 0.05, 0.02], [-0.08, 0.12, -0.03]])
    ways = np.array([[0.6, 0.0, 0.8], [0.3, -0.9, 0.2]])

    def travel(loaded: int, read: int) -> float:
        """Movement in m along way `read` of its point by 1 N at the other."""
        place = []
        for size in (10.0, -10.0):
            state = machine.solve(q, p, loads=[DeadForce(size * ways[loaded], points[loaded])]).state
            place.append(state.position + state.rotation @ points[read])
        return float((place[0] - place[1]) @ ways[read]) / 20

    assert travel(0, 1) == pytest.approx(travel(1, 0), rel=1e-7)
