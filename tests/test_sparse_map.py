"""Constant linear maps against their definition, entry by entry."""

from __future__ import annotations

import numpy as np
import pytest

from pkmcal_cli.base.rotation import Array
from pkmcal_cli.base.sparse_map import SparseMap

HEIGHT, COLUMNS, ENTRIES = 12, 9, 40
FACTOR = np.random.default_rng(1).normal(size=ENTRIES)
TARGET, SOURCE = np.random.default_rng(2).integers(0, (HEIGHT, COLUMNS - 1), (ENTRIES, 2)).T  # the last is not used
MAP = SparseMap(HEIGHT, COLUMNS, TARGET, SOURCE, FACTOR)


def by_definition(x: Array) -> Array:
    out = np.zeros((HEIGHT, x.shape[1]), dtype=x.dtype)
    for target, source, factor in zip(TARGET, SOURCE, FACTOR, strict=True):
        out[target] += factor * x[source]
    return out


@pytest.mark.parametrize("rows", [1, 2, 30, 400])
@pytest.mark.parametrize("turn", [1.0, 1.0 + 0.5j])
def test_entries_add_up(rows: int, turn: complex) -> None:
    x = turn * np.random.default_rng(rows).normal(size=(COLUMNS, rows))
    np.testing.assert_allclose(MAP(x), by_definition(x), rtol=0, atol=1e-14)


@pytest.mark.parametrize("rows", [1, 30, 400])
def test_what_is_not_finite_goes_no_further_than_its_targets(rows: int) -> None:
    x = np.random.default_rng(rows).normal(size=(COLUMNS, rows))
    plain = MAP(x)
    x[-1], x[3, 0] = np.nan, np.inf
    touched = np.zeros(plain.shape, dtype=bool)
    touched[TARGET[SOURCE == 3], 0] = True
    np.testing.assert_array_equal(np.isfinite(MAP(x)), ~touched)
    np.testing.assert_array_equal(MAP(x)[~touched], plain[~touched])
