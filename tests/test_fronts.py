"""Solution front by front against one dense matrix, and which unknowns leave together."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from benchmarks.predictions import hexapod
from benchmarks.structures import structure
from pkmcal_cli.base.rotation import Array
from pkmcal_cli.equilibrium.assembly import balance, typical_stiffness
from pkmcal_cli.equilibrium.branch import strain_jacobian, strains_exceed
from pkmcal_cli.equilibrium.fronts import FrontLayout
from pkmcal_cli.equilibrium.kinematics import State, advance
from pkmcal_cli.equilibrium.partition import fronts_of
from pkmcal_cli.equilibrium.stability import definite
from pkmcal_cli.equilibrium.system import System
from pkmcal_cli.equilibrium.tangent import FrontTangent, Tangent, solve_rows
from pkmcal_cli.prediction.pipeline import predict
from pkmcal_cli.prediction.stages import BaseCoefficients, commanded_coefficients

CASES = ("hexapod7", "chain", "platform", "gantry")


@cache
def case(name: str) -> tuple[System, Array, State]:
    """A system, coefficients and states at which nothing is in balance."""
    if name == "hexapod7":
        task = hexapod(5)
        base = BaseCoefficients.of(task.model, task.values, task.rows)
        coefficients = commanded_coefficients(task.model, base, task.rows)
        system, state = task.model.exact, predict(task.model, task.values, task.rows).state
    else:
        frame = structure(name, {"chain": 17, "platform": 8, "gantry": 18}[name], 5)
        system, coefficients, state = frame.model.exact, frame.coefficients, frame.state
    random = np.random.default_rng(1).uniform(-1e-4, 1e-4, (5, system.size))
    return system, coefficients, advance(system, state, random, typical_stiffness(system, coefficients))


def tangent(name: str) -> FrontTangent:
    system, coefficients, state = case(name)
    found = balance(system, coefficients, state, typical_stiffness(system, coefficients)).tangent
    assert isinstance(found, FrontTangent)
    return found


def assert_solves(found: Tangent, matrix: Array) -> None:
    """The equations hold as well as those that one dense matrix solves."""
    right = np.random.default_rng(0).normal(size=(*matrix.shape[:2], 3))
    for solve, of in ((found.solve, matrix), (found.solve_transposed, np.swapaxes(matrix, 1, 2))):
        x, dense = solve(right), np.linalg.solve(of, right)
        size = np.abs(of).sum(axis=2, keepdims=True) * np.abs(dense).max(axis=1, keepdims=True)
        assert (np.abs(of @ x - right) <= 1e-13 * size).all()
        assert np.abs(x - dense).max() <= 1e-9 * np.abs(dense).max()


@pytest.mark.parametrize("name", CASES)
def test_fronts_solve_the_same_equations(name: str) -> None:
    found = tangent(name)
    assert_solves(found, found.dense())
    assert not len(found.whole)


@pytest.mark.parametrize("name", CASES)
def test_every_entry_has_one_place(name: str) -> None:
    """The dense matrix is filled through the layout; element by element the entries are the energy's derivatives."""
    system, coefficients, state = case(name)
    scale, matrix = typical_stiffness(system, coefficients), tangent(name).dense()
    for column in (0, system.unknowns // 2, system.size - 1):
        step = np.zeros((len(state), system.size), dtype=complex)
        step[:, column] = 1e-30j
        moved = balance(system, coefficients, advance(system, state, step, scale), scale, tangent=False, taut=True)
        expected = moved.residual.imag / 1e-30
        assert np.abs(matrix[:, :, column] - expected).max() <= 1e-9 * np.abs(expected).max()


@pytest.mark.parametrize("name", CASES)
def test_what_strains_hold_is_seen_front_by_front(name: str) -> None:
    """Against the singular values of the whole Jacobian; rows fail by themselves, wherever they do."""
    system, coefficients, state = case(name)
    values = np.linalg.svd(strain_jacobian(system, coefficients, state, 0.5), compute_uv=False)
    assert values.shape == (5, system.unknowns)
    for share, which in ((0.999, -1), (1.001, -1), (0.5, 0), (1.5, system.unknowns // 2), (0.0, 0)):
        bound = share * values[:, which] ** 2
        expected = values[:, -1] ** 2 > bound
        assert (strains_exceed(system, coefficients, state, 0.5, bound) == expected).all(), (share, which)
        bound[[1, 3]] = 1e-30
        expected[[1, 3]] = True
        lost = replace(state, translation=np.where(np.arange(5)[:, None] == 4, np.nan, state.translation))
        assert (strains_exceed(system, coefficients, lost, 0.5, bound) == [*expected[:4], False]).all()


def test_legs_of_the_hexapod_leave_one_by_one_and_the_platform_last() -> None:
    """Seven legs of 12 unknowns and one multiplier, a border of the platform's six."""
    layout = case("hexapod7")[0].maps.fronts
    assert layout is not None
    legs, platform = layout.sets
    assert legs.own.shape == (7, 13) and legs.border.shape == (7, 6) and legs.unknowns == 12
    assert (legs.border == platform.own).all() and len(legs.sums) == 1


def test_a_long_chain_falls_apart_by_halves() -> None:
    """Rounds grow with the logarithm of the length, not with the length."""
    system = structure("chain", 64, 1).model.exact
    assert system.maps.fronts is not None
    assert len(system.maps.fronts.sets) <= 2 * np.log2(64) + 2
    assert max(group.own.shape[1] for group in system.maps.fronts.sets) <= 18


def test_small_and_full_matrices_stay_whole() -> None:
    assert fronts_of(np.eye(39, dtype=bool), 39) == ()
    assert fronts_of(np.ones((80, 80), dtype=bool), 80) == ()


def star(random: np.random.Generator, rows: int, held: bool) -> tuple[FrontTangent, Array]:
    """Twelve legs of five unknowns, one constraint in each where `held`, on a platform of four: random symmetric."""
    legs, width, top = 12, 5, 4
    n = legs * width + top
    size = n + legs * held
    matrix = np.zeros((rows, size, size))
    for leg in range(legs):
        own = [*range(width * leg, width * (leg + 1)), *range(n - top, n)]
        half = random.normal(size=(rows, len(own), len(own)))
        matrix[np.ix_(range(rows), own, own)] += half @ np.swapaxes(half, 1, 2) + 0.1 * np.eye(len(own))
        if held:
            slope = random.normal(size=(rows, len(own)))
            matrix[:, n + leg, own] = slope
            matrix[:, own, n + leg] = slope
    row, column = np.nonzero(matrix[0])
    layout = FrontLayout.of(row, column, size, n)
    assert layout is not None
    entries = np.zeros((rows, layout.width))
    entries[:, layout.places(row, column)] = matrix[:, row, column]
    return FrontTangent(entries, layout), matrix


@pytest.mark.parametrize("held", [False, True])
def test_stable_where_the_reduced_matrix_has_positive_eigenvalues(held: bool) -> None:
    """Null space of the constraints and eigenvalues, against the inertia of the pivots; one row in four is a saddle."""
    found, matrix = star(np.random.default_rng(3), 40, held)
    n = found.layout.unknowns
    free = [np.linalg.svd(m[n:, :n])[2][m.shape[0] - n :].T if held else np.eye(n) for m in matrix]
    lowest = np.array([np.linalg.eigvalsh(z.T @ m[:n, :n] @ z)[0] for m, z in zip(matrix, free, strict=True)])
    shift = np.where(np.arange(40) % 4 == 0, 1.2, 0.8) * lowest
    diagonal = found.layout.row == found.layout.column
    own = diagonal & (found.layout.row < n)
    found.entries[:, own] -= shift[:, None]
    found.solve(np.ones((40, len(matrix[0]), 1)))
    expected = np.arange(40) % 4 != 0
    assert (found.stable(np.arange(40)) == expected).all()
    dense = found.dense()
    assert (definite(dense[:, :n, :n], dense[:, n:, :n]) == expected).all()
    assert (found.stable(np.array([4, 7])) == [False, True]).all()


@pytest.mark.parametrize("factor", [0.0, 1e-9])
def test_rows_with_a_singular_pivot_are_solved_as_one_matrix(factor: float) -> None:
    """A leg that only the platform holds, or nearly so, has no pivot of its own; the whole is solved as before."""
    found, _ = star(np.random.default_rng(4), 6, held=False)
    layout, leg = found.layout, np.arange(5)
    inside = np.isin(layout.row, leg) & np.isin(layout.column, leg)
    found.entries[2, inside] *= factor
    matrix = found.dense()
    right = np.random.default_rng(0).normal(size=(6, layout.size, 1))
    x = found.solve(right)
    fine = [0, 1, 3, 4, 5]
    assert np.allclose(x[fine], np.linalg.solve(matrix[fine], right[fine]), rtol=1e-9, atol=1e-12)
    assert 2 in found.whole
    assert np.array_equal(x[2:3], solve_rows(matrix[2:3], right[2:3]), equal_nan=True)
