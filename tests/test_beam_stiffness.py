"""Stiffness matrices of beam elements at rest against those of the books."""

from __future__ import annotations

import numpy as np
import pytest

from pkmcal_cli.base.rotation import Array, exp
from pkmcal_cli.elements import BeamElement, LinkGeometry


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


def node_matrix(element: BeamElement, length: float, numbers: list[float], position: Array) -> Array:
    """K = B^T S B of a beam at rest in a position (3, 3), by the displacements of its two nodes."""
    chord, triad = (x[None, None] for x in (position @ np.array([length, 0, 0]), position))
    rest = np.array([length] + [0.0] * (len(element.strains) - 1))
    b = element.evaluate(LinkGeometry(chord, triad, triad, np.empty((1, 1, 0))), rest)[1][0, 0]
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
    q = np.eye(3) if seed == 0 else exp(rng.normal(size=3))
    t = np.kron(np.eye(4), q)  # eq. 6: node displacements of the local frame in base axes
    expected = t @ beam_matrix(length, ea, gj, eiy, eiz) @ t.T
    found = node_matrix(BeamElement(), length, [ea / length, gj / length, eiy / length, eiz / length], q)
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
    found = node_matrix(BeamElement(planar=True), length, [ea / length, ei / length], q)
    assert np.abs(found[np.ix_(planar, planar)] - t @ expected @ t.T).max() < 1e-14 * np.abs(expected).max()
    across = [2, 3, 4, 8, 9, 10]
    assert np.abs(found[across]).max() == 0.0
