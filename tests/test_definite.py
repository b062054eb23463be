"""Definite equations against numpy's general ones, and what a linearised problem projects out by them."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.linalg import LinAlgError, block_diag

from pkmcal_cli.base.definite import factored, solved, with_diagonal
from tests.benchmark.setting import Setting


def matrix(size: int) -> np.ndarray:
    a = np.random.default_rng(size).normal(size=(3 * size, size))
    return a.T @ a


@pytest.mark.parametrize("size", [1, 2, 40])
def test_solutions_are_those_of_the_general_equations(size: int) -> None:
    a, right = matrix(size), np.random.default_rng(1).normal(size=(size, 5))
    for x in (right, np.asfortranarray(right), right[:, 0], right[:, ::2], right[:, :0]):
        before = x.copy()
        assert solved(factored(a), x) == pytest.approx(np.linalg.solve(a, x), rel=1e-9, abs=1e-12)
        assert np.array_equal(x, before), "right sides stay what they are"


def test_of_nothing_there_is_nothing_and_of_what_is_not_definite_an_error() -> None:
    assert solved(factored(np.zeros((0, 0))), np.zeros((0, 3))).shape == (0, 3)
    for wrong in (-np.eye(2), np.array([[1.0, 2.0], [2.0, 1.0]])):
        with pytest.raises(LinAlgError):
            factored(wrong)


def test_a_diagonal_stands_beside_a_matrix() -> None:
    for first, diagonal in ((matrix(3), [2.0, 0.0, 5.0]), (np.zeros((0, 0)), [1.0])):
        assert np.array_equal(with_diagonal(first, np.array(diagonal)), block_diag(first, np.diag(diagonal)))
    assert np.array_equal(with_diagonal(matrix(3), np.zeros(0)), matrix(3))


def test_least_squares_are_taken_off_of_all_that_is_projected_out() -> None:
    """Of parameters that the data determine and of further columns, from whichever problem these were projected out."""
    linear = Setting.of("scissors", 11).linear
    rng = np.random.default_rng(0)
    extra, x = rng.normal(size=(len(linear.residual), 3)), rng.normal(size=(len(linear.residual), 4))
    for names in (linear.projected, linear.projected[:4], ()):
        without = linear.projecting(names)
        for there in (without, linear.projecting(names, extra=extra), without.besides(extra)):
            a, prior = there.of(names), np.zeros((len(names), len(names)))  # the data determine all of them
            if there.extra is not None:
                a, prior = np.hstack([a, extra]), block_diag(prior, np.diag(1e-6 * (extra**2).sum(axis=0) + 1e-12))
            expected = x - a @ np.linalg.solve(a.T @ a + prior, a.T @ x) if a.shape[1] else x
            assert there.free(x) == pytest.approx(expected, abs=1e-9)
