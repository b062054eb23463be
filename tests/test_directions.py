"""Directions of small Jacobians by hand: what is null, weak, shared, and what of it is determined."""

from __future__ import annotations

import re

import numpy as np
import pytest

from pkmcal_cli.calibration.identifiability import Combination, Directions, combinations, directions, sparse_basis
from pkmcal_cli.report.parameters import combination_json
from tests.support import model


def found_in(rows: list[list[float]], ranges: list[float] | None = None) -> Directions:
    jacobian = np.array(rows, dtype=float)
    names = tuple("abcdefgh"[: jacobian.shape[1]])
    return directions(jacobian, names, np.ones(len(names)) if ranges is None else np.array(ranges))


def test_variances_by_hand() -> None:
    """1/s^2, and the prior's 1/4 where that is less; independent parameters, s = 10, 1."""
    found = found_in([[10, 0], [0, 1], [0, 0]])
    assert found.weak.tolist() == [False, True]
    assert found.covariance() == pytest.approx(np.diag([0.01, 0.25]))
    assert found_in([[10, 0], [0, 2.001]]).weak.tolist() == [False, False]
    assert found_in([[1, 0], [0, 0.1]], [10, 20]).covariance() == pytest.approx(np.diag([1, 100]))


def test_null_by_ratio_or_by_reach() -> None:
    assert found_in([[1e12, 0], [0, 10]]).null.tolist() == [False, True]
    assert found_in([[10, 0], [0, 0.009]]).null.tolist() == [False, True]
    assert found_in([[10, 0], [0, 0.011]]).null.tolist() == [False, False]
    assert found_in([[0, 0]]).null.all()
    assert found_in([[3, 4]]).null.tolist() == [False, True]


def test_small_shares_of_a_dim_direction_keep_their_interval() -> None:
    """A component of 5 % of a direction that is seen a little: its prior is in the uncertainty, 0.05 / 2 ranges."""
    turn = np.array([[np.cos(0.05), np.sin(0.05)], [-np.sin(0.05), np.cos(0.05)]])
    found = directions(np.diag([100.0, 0.005]) @ turn, ("a", "b"), np.ones(2))
    assert found.undetermined().tolist() == [False, True]
    assert np.sqrt(found.covariance()[0, 0]) == pytest.approx(np.hypot(0.01, 0.5 * np.sin(0.05)), rel=1e-2)
    exact = directions(np.diag([100.0, 0.0]) @ turn, ("a", "b"), np.ones(2))
    assert exact.undetermined().all()


def test_groups_of_null_directions() -> None:
    """a + b and c + 2 d are seen, e is not at all, f is."""
    found = found_in([[9, 9, 0, 0, 0, 0], [0, 0, 8, 16, 0, 0], [0, 0, 0, 0, 0, 7]])
    null = {c.names: c for c in combinations(found)}
    assert null.keys() == {("a", "b"), ("c", "d"), ("e",)}
    assert null["a", "b"].determined == pytest.approx(np.array([[1, 1]]))
    assert null["c", "d"].determined == pytest.approx(np.array([[1, 2]]))
    assert null["e",].text == "e has no effect on these readings"
    assert np.isnan(found.covariance()[:5]).all()
    assert found.covariance()[5, 5] == pytest.approx(1 / 49)


@pytest.mark.parametrize("seed", range(5))
def test_determined_sums_do_not_feel_null_directions(seed: int) -> None:
    """Random null spaces: what is determined is at right angles to what is not, and spans the rest."""
    rng = np.random.default_rng(seed)
    ranges = 10.0 ** rng.uniform(-5, 1, 6)
    jacobian = (100 * rng.normal(size=(9, 4)) @ rng.normal(size=(4, 6))) / ranges
    found = directions(jacobian, tuple("abcdef"), ranges)
    (combination,) = combinations(found)
    index = ["abcdef".index(n) for n in combination.names]
    unseen = found.vectors[found.null][:, index] * ranges[index]
    scaled = combination.determined * ranges[index]
    assert np.linalg.matrix_rank(scaled / np.abs(scaled).max(axis=1, keepdims=True)) == len(index) - 2
    shares = (combination.determined @ unseen.T) / np.linalg.norm(scaled, axis=1)[:, None]
    assert np.abs(shares).max() < 1e-9


@pytest.mark.parametrize("seed", range(20))
def test_every_null_direction_is_told_and_the_advice_determines_the_rest(seed: int) -> None:
    """Random null spaces of one to four dimensions, shared by all or in groups: each parameter that is undetermined is
    named, no coefficient is 0, and without the parameters to be held the data see all.
    """
    rng = np.random.default_rng(seed)
    names, rank = tuple("abcdefg"), int(rng.integers(3, 7))
    jacobian = 100 * rng.normal(size=(12, rank)) @ rng.normal(size=(rank, 7))
    if seed % 2:
        jacobian[:, :3] = rng.normal(size=(12, 1)) @ [[1e3, 2e3, -1e3]]  # a group of its own
    found = directions(jacobian, names, np.ones(7))
    null = [c for c in combinations(found) if c.kind == "null"]
    assert sum(len(c.motions) for c in null) == int(found.null.sum()) == 7 - found.rank
    assert np.abs(jacobian @ _full(null, names).T).max() < 1e-6
    told = {n for n in names if any(re.search(rf"\b{n} ([+-]|has)", text) for c in null for text in c.texts)}
    assert told == {n for n, lost in zip(names, found.undetermined(), strict=True) if lost}
    shown = [each for c in null for each in combination_json(model("triglide"), c)]
    assert len(shown) == found.null.sum() and all(v for each in shown for v in each["parameters"].values())
    hold = [n for c in null for n in c.hold]
    rest = [k for k, n in enumerate(names) if n not in hold]
    assert len(hold) == len(set(hold)) == found.null.sum()
    assert not directions(jacobian[:, rest], tuple(names[k] for k in rest), np.ones(len(rest))).null.any()


def _full(null: list[Combination], names: tuple[str, ...]) -> np.ndarray:
    """Motions (k, p) of all parameters."""
    rows = []
    for c in null:
        for motion in c.motions:
            row = np.zeros(len(names))
            row[[names.index(n) for n in c.names]] = motion
            rows.append(row)
    return np.array(rows)


def test_sparse_basis_spans_the_same() -> None:
    rng = np.random.default_rng(0)
    basis = rng.normal(size=(2, 5))
    sparse = sparse_basis(basis)
    assert np.linalg.matrix_rank(np.vstack([basis, sparse]), tol=1e-9) == 2
    assert (sparse == 0).sum() >= 2
    assert np.abs(sparse).max(axis=1) == pytest.approx([1, 1])
    assert sparse_basis(np.zeros((0, 3))).shape == (0, 3)


def test_what_has_no_effect_is_a_direction_of_its_own_exactly() -> None:
    """Rounding would let the others move it: a lag by 1e-14 s, which takes a column that the table lacks."""
    generator = np.random.default_rng(3)
    jacobian = generator.normal(size=(60, 7)) * 10.0 ** generator.integers(-1, 2, 7)
    jacobian[:, [2, 5]] = 0.0
    for rows in (60, 20, 3):
        found = directions(jacobian[:rows], tuple("abcdefg"), np.ones(7))
        assert found.rank == min(rows, 5) and np.allclose(found.vectors @ found.vectors.T, np.eye(7))
        assert not found.vectors[~found.null][:, [2, 5]].any()
        alone = found.vectors[found.vectors[:, [2, 5]].any(axis=1)]
        assert sorted(map(tuple, alone.tolist())) == sorted(map(tuple, np.eye(7)[[2, 5]].tolist()))
