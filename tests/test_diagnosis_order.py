"""Directions of motion follow from the order of rows; nothing else in a diagnosis depends on it."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from pkmcal_cli.base.rotation import Array
from pkmcal_cli.diagnosis.run_diagnosis import Diagnosis
from pkmcal_cli.loading.covariates import directions, with_directions
from pkmcal_cli.prediction import Rows
from tests.benchmark.setting import diagnosed
from tests.truth.campaigns import Campaign, campaign, unit


# --- directions ----------------------------------------------------------------------------
def test_directions_follow_the_order_of_rows() -> None:
    """A still drive keeps its direction; each session begins without one."""
    readings = np.array([[0.0, 5], [1, 5], [1, 4], [3, 4], [2, 4], [2, 6], [1, 6]])
    session = np.array([0, 0, 0, 0, 1, 1, 1])
    by_hand = [[0, 0], [1, 0], [1, -1], [1, -1], [0, 0], [0, 1], [-1, 1]]
    np.testing.assert_array_equal(directions(readings, session), by_hand)
    np.testing.assert_array_equal(directions(readings, 0 * session)[4], [-1, -1])
    np.testing.assert_array_equal(directions(-readings, session), -np.array(by_hand))
    wobble = readings + 1e-12 * np.random.default_rng(0).normal(size=readings.shape)
    np.testing.assert_array_equal(directions(wobble, session), by_hand)


def test_given_directions_stay_and_gaps_are_derived() -> None:
    given = {"dir.a": np.array([-1.0, np.nan, -1.0]), "session.s": np.ones(3)}
    readings = np.array([[0.0, 0], [1, -1], [2, -2]])
    rows = with_directions(Rows(readings, np.full((3, 2), np.nan), given), ["a", "b"])
    np.testing.assert_array_equal(rows.columns["dir.a"], [-1, 1, -1])
    np.testing.assert_array_equal(rows.columns["dir.b"], [0, -1, -1])


# --- what must not matter ------------------------------------------------------------------
@cache
def backlash_campaign() -> Campaign:
    return campaign("scissors", [unit("scissors", "backlash", "q3", 9).scaled(0.4)], 9)


def changed(order: Array | None = None, **columns: object) -> Diagnosis:
    """The diagnosis of the campaign with rows in another order, or other circumstances."""
    plain = backlash_campaign()
    now = replace(plain.conditions, **columns)  # type: ignore[arg-type]
    return diagnosed(Shuffled(**{**vars(plain), "conditions": now}).in_order(order), 0)


class Shuffled(Campaign):
    """A campaign whose table has its rows in another order."""

    order: Array | None = None

    def in_order(self, order: Array | None) -> Shuffled:
        """The same with rows in this order."""
        object.__setattr__(self, "order", order)
        return self

    def columns(self) -> dict[str, list[str]]:
        """Cells of the table by heading."""
        table = super().columns()
        return table if self.order is None else {h: [v[int(k)] for k in self.order] for h, v in table.items()}


def same(a: Diagnosis, b: Diagnosis, sign: float = 1.0) -> None:
    """The same effects of the same size (b's with another sign) and the same parameters."""
    assert [f.hypothesis for f in a.findings] == [f.hypothesis for f in b.findings] != []
    for one, other in zip(a.findings, b.findings, strict=True):
        np.testing.assert_allclose(one.estimate, sign * np.array(other.estimate), rtol=1e-4)
        np.testing.assert_allclose(one.std, other.std, rtol=1e-4)
        assert one.evidence == pytest.approx(other.evidence, rel=1e-4)
    assert a.search.fit.chi2 == pytest.approx(b.search.fit.chi2, rel=1e-6)
    declared = [a.problem.model.names.index(n) for n in a.search.declared]
    shift = (a.search.fit.values - b.search.fit.values)[declared] / a.problem.model.ranges[declared]
    assert np.abs(shift).max() < 1e-5


def test_the_order_of_rows_does_not_matter() -> None:
    plain = backlash_campaign()
    order = np.random.default_rng(0).permutation(len(plain.readings))
    same(changed(), changed(order))


@pytest.mark.slow
def test_the_zero_of_time_does_not_matter() -> None:
    same(changed(), changed(time=backlash_campaign().conditions.time + 86400.0))


@pytest.mark.slow
def test_the_sense_of_directions_only_turns_backlash() -> None:
    same(changed(), changed(direction=-backlash_campaign().conditions.direction), sign=-1.0)
