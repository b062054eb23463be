"""The frames of fine beam elements against closed forms, and the gantry's meshes against finer ones."""

from __future__ import annotations

import numpy as np
import pytest

from .frame import Array, Frame, Section, rotation
from .gantry import RANGES, Bow, Gantry

EA, EIY, EIZ, GJ = 1e9, 2e4, 1e4, 1.5e4
LENGTH, LOAD = 2.0, 1e-3
NOWHERE = np.zeros(3)


def cantilever(pieces: int, force: Array, point: Array = NOWHERE, weight: Array = NOWHERE) -> tuple[Array, Array]:
    """Displacement and turn (3, 3) of the tip of a beam along x that is clamped at the origin."""
    frame = Frame()
    frame.body(NOWHERE, None, np.zeros((6, 0)))
    tip = frame.body([LENGTH, 0, 0])
    frame.beam(0, tip, (NOWHERE, NOWHERE), LENGTH, Section(ea=EA, eiy=EIY, eiz=EIZ, gj=GJ, weight=weight), pieces)
    frame.forces.append((tip, point, force))
    frame.solve()
    return frame.at(tip, NOWHERE) - [LENGTH, 0, 0], frame.turn[tip]


@pytest.mark.parametrize("pieces", [1, 7])
def test_cantilever(pieces: int) -> None:
    """F L^3 / 3 EI and F L^2 / 2 EI about both axes, F L / EA; r F L / GJ of a force at an arm r."""
    found, turn = cantilever(pieces, np.array([0, LOAD, 0]))
    assert found[1] == pytest.approx(LOAD * LENGTH**3 / 3 / EIZ, rel=1e-9)
    assert turn[1, 0] == pytest.approx(LOAD * LENGTH**2 / 2 / EIZ, rel=1e-9)
    found, turn = cantilever(pieces, np.array([0, 0, LOAD]), np.array([0, 0.5, 0]))
    assert found[2] == pytest.approx(LOAD * LENGTH**3 / 3 / EIY, rel=1e-9)
    assert turn[2, 0] == pytest.approx(LOAD * LENGTH**2 / 2 / EIY, rel=1e-9)
    assert turn[2, 1] == pytest.approx(0.5 * LOAD * LENGTH / GJ, rel=1e-9)
    found, _ = cantilever(pieces, np.array([1e3, 0, 0]))
    assert found[0] == pytest.approx(1e3 * LENGTH / EA, rel=1e-9)


@pytest.mark.parametrize("pieces", [1, 5])
def test_own_weight(pieces: int) -> None:
    """w L^4 / 8 EI; exact with any number of elements."""
    found, _ = cantilever(pieces, NOWHERE, weight=np.array([0, 0, -LOAD]))
    assert found[2] == pytest.approx(-LOAD * LENGTH**4 / 8 / EIY, rel=1e-9)


def test_a_pull_along_the_beam_stiffens_it() -> None:
    """F / (k P) (k L - tanh k L), k^2 = P / EI: the beam-column under tension, extrapolated."""
    pull = 2e3
    k = np.sqrt(pull / EIZ)
    found = [cantilever(n, np.array([pull, LOAD, 0]))[0][1] for n in (16, 32)]
    stretched = LENGTH * (1 + pull / EA)
    closed = LOAD / (k * pull) * (k * stretched - np.tanh(k * stretched))
    assert found[1] + (found[1] - found[0]) / 3 == pytest.approx(closed, rel=1e-5)
    assert closed < 0.8 * LOAD * LENGTH**3 / 3 / EIZ


def test_energy_is_the_same_for_the_frame_turned() -> None:
    """The tip of a skew force, in the axes of the beam."""
    turn = rotation(np.array([0.5, -1.0, 0.7]))
    force = np.array([3.0, 40.0, -50.0])
    straight, _ = cantilever(6, force)
    frame = Frame()
    frame.body(NOWHERE, turn, np.zeros((6, 0)))
    tip = frame.body(turn @ [LENGTH, 0, 0], turn)
    frame.beam(0, tip, (NOWHERE, NOWHERE), LENGTH, Section(ea=EA, eiy=EIY, eiz=EIZ, gj=GJ), 6)
    frame.forces.append((tip, NOWHERE, turn @ force))
    frame.solve()
    assert np.abs(turn.T @ frame.at(tip, NOWHERE) - [LENGTH, 0, 0] - straight).max() < 1e-13


def test_finer_meshes_of_the_gantry_agree() -> None:
    """Extrapolated readings with half the elements, all parameters off and the rail bowed; the error falls by 16."""
    rng = np.random.default_rng(3)
    values = {n: v + RANGES[n] * rng.uniform(-1, 1) for n, v in Gantry().nominal.items()}
    readings = np.array([[0.4, 0.4002, 0.3], [1.4, 1.4, 1.2]])
    found = [Gantry(bow=Bow(x=9e-5), pieces=p).forward(readings, values).tcp for p in ((4, 8), (8, 16))]
    assert np.abs(found[1] - found[0]).max() < 3e-11
