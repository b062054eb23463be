"""The trust region of a fit: confined steps are optimal; its shape follows what was felt."""

from __future__ import annotations

import numpy as np
import pytest

from pkmcal_cli.calibration.trust_region import Region, confined

NOTHING = np.zeros(2)  # residuals


@pytest.mark.parametrize("seed", range(5))
def test_a_confined_step_is_the_best_one_within_the_radius(seed: int) -> None:
    rng = np.random.default_rng(seed)
    matrix, right, size = rng.normal(size=(12, 4)), rng.normal(size=12), rng.normal(size=(5, 4))
    free = np.linalg.lstsq(matrix, right, rcond=None)[0]
    radius = 0.3 * float(np.linalg.norm(size @ free))
    step = confined(matrix, right, size, radius)
    length = float(np.linalg.norm(size @ step))
    assert 0.98 * radius <= length <= radius
    downhill, outwards = matrix.T @ (right - matrix @ step), size.T @ (size @ step)
    multiplier = float(downhill @ outwards) / float(outwards @ outwards)
    assert multiplier > 0.0
    np.testing.assert_allclose(downhill, multiplier * outwards, atol=1e-9)  # of a convex problem: the minimum


@pytest.mark.parametrize("radius", [1e-9, 1e-3, 0.999])
def test_a_step_is_never_longer_than_the_radius(radius: float) -> None:
    """Also where columns differ by twelve orders of magnitude."""
    rng = np.random.default_rng(1)
    matrix, size = rng.normal(size=(20, 3)) * [1.0, 1e-6, 1e6], np.diag([1.0, 1e-6, 1e6])
    step = confined(matrix, rng.normal(size=20), size, radius * 0.1)
    assert 0.0 < np.linalg.norm(size @ step) <= 0.1 * radius


def test_what_readings_no_longer_feel_moves_no_further_than_before() -> None:
    """The second parameter hardly moves the readings where the first step led."""
    region = Region().at(np.diag([1.0, 2.0]), NOTHING)
    assert region.at(np.diag([5.0, 1e-6]), NOTHING).size == pytest.approx([5.0, 2.0])


def test_a_step_that_keeps_its_promise_widens_and_one_that_is_refused_narrows() -> None:
    region = Region().at(np.eye(2), NOTHING).narrowed()
    step = np.array([region.radius, 0.0])
    assert region.taken(step, 1.0, 0.5).radius > region.radius > region.taken(step, 0.1, 0.5).radius > 0.0
    assert region.taken(step, 0.5, 0.5).radius == region.radius
    refused = region.refused(step)
    assert refused.radius < region.radius and refused.damping == 1.0
    assert refused.taken(0.1 * step, 0.9, 0.5).damping == 0.0


def test_steps_are_free_until_a_far_one_keeps_little() -> None:
    """Such a step is taken back, and those that follow are confined; one that fails is only damped."""
    region = Region().at(np.eye(2), NOTHING)
    far, near = np.array([1e6, 0.0]), np.array([1.0, 0.0])
    assert region.radius == np.inf and region.doubts(far, 0.5)
    assert not region.doubts(far, 0.9) and not region.doubts(near, 0.1)
    assert not region.narrowed().doubts(far, 0.1) and region.narrowed().radius < region.length(far)
    failed = region.refused(far)
    assert failed.radius == np.inf and failed.damping == 1.0 and not failed.doubts(far, 0.1)


def test_steps_that_creep_are_counted_until_one_gets_on() -> None:
    """Those of a fit far off that needs heavy damping: each gains less than a hundredth of chi-square."""
    step = np.array([1e-6, 0.0])
    region = Region(size=np.ones(2), damping=1e8)
    for _ in range(3):
        region = region.taken(step, 0.4, 0.005)
    assert region.creeping == 3 and region.taken(step, 0.4, 0.02).creeping == 0
    assert Region(size=np.ones(2), damping=10.0).taken(step, 0.4, 0.005).creeping == 0
