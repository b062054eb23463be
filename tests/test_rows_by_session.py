"""Parameters of one session each: the same fits as with one large normal matrix."""

from __future__ import annotations

import numpy as np
import pytest

from pkmcal_cli.diagnosis.rows_by_session import KNOWN, RowsBySession

SHARED, OWN, SESSIONS, ROWS, CHANNELS = 4, 3, 5, 60, 2


def test_steps_and_uncertainties_are_those_of_the_whole_normal_matrix() -> None:
    """Of four parameters that sessions share and three of each, but one of the last; in any order."""
    rng = np.random.default_rng(3)
    session = rng.integers(SESSIONS, size=ROWS)
    places = rng.permutation(np.append(np.full(SHARED, -1), np.repeat(np.arange(SESSIONS), OWN)[:-1]))  # (p,)
    jacobian = rng.normal(size=(ROWS, CHANNELS, len(places)))
    jacobian *= (places < 0) | (places == session[:, None])[:, None]
    residual, offsets = rng.normal(size=(ROWS, CHANNELS)), rng.normal(size=len(places))
    rows = RowsBySession.of(residual, jacobian, np.ones_like(residual, dtype=bool), session, offsets)
    assert (rows.shared.shape[2], rows.local.shape[2]) == (SHARED, OWN)
    chosen = rng.random((3, ROWS)) < 0.7
    steps = rows.fit(chosen)
    for k, some in enumerate(chosen):
        table = jacobian[some].reshape(-1, len(places))
        inverse = np.linalg.inv(table.T @ table + KNOWN * np.eye(len(places)))
        left = residual - jacobian @ (inverse @ (table.T @ residual[some].ravel() - KNOWN * offsets))
        np.testing.assert_allclose(rows.squares(steps)[k], (left**2).sum(axis=1), rtol=1e-9)
        if k == 0:
            np.testing.assert_allclose(rows.left(steps), left, atol=1e-12)
            np.testing.assert_allclose(rows.leverage(steps), jacobian @ inverse @ jacobian.swapaxes(1, 2), rtol=1e-9)
            assert steps.determined() == pytest.approx(len(inverse) - KNOWN * np.trace(inverse), rel=1e-12)


def test_what_acts_in_one_session_alone_is_shared_where_there_is_no_other() -> None:
    jacobian = np.ones((8, 1, 2))
    rows = RowsBySession.of(np.ones((8, 1)), jacobian, np.ones((8, 1), dtype=bool), np.zeros(8, dtype=int), np.zeros(2))
    assert rows.local.shape[2] == 0 and rows.shared is jacobian
