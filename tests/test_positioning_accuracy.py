"""Acceptance figures against the standards' formulas written anew, with plain loops, on planted deviations."""

from __future__ import annotations

import math
import statistics

import numpy as np
import pytest

from pkmcal_cli.base.rotation import Array
from pkmcal_cli.calibration.positioning_accuracy import axis_accuracy, circle_deviation, pose_accuracy

RNG = np.random.default_rng(11)
TARGETS = np.array([0.0, 0.1, 0.2, 0.3, 0.45, 0.6])


def planted(seed: int, approaches: int = 5) -> tuple[tuple[Array, Array], ...]:
    """Deviations with an error along the axis, a reversal and scatter that differs from target to target, m."""
    rng = np.random.default_rng(seed)
    out = []
    for k, at in enumerate(TARGETS):
        up = 3e-6 * math.sin(7 * at) + 2e-6 + rng.normal(0, (1 + k) * 0.4e-6, approaches)
        down = 3e-6 * math.sin(7 * at) - 1e-6 * k + rng.normal(0, 0.7e-6, approaches + k)
        out.append((up, down))
    return tuple(out)


def by_the_standard(deviations: tuple[tuple[Array, Array], ...]) -> dict[str, float]:
    """ISO 230-2:2014, target by target."""
    most, least, means, reversals, repeat = [], [], [], [], []
    for pair in deviations:
        m_up, m_down = (statistics.fmean(float(v) for v in side) for side in pair)
        s_up, s_down = (statistics.stdev(float(v) for v in side) for side in pair)
        most += [m_up + 2 * s_up, m_down + 2 * s_down]
        least += [m_up - 2 * s_up, m_down - 2 * s_down]
        means.append((m_up, m_down))
        reversals.append(m_up - m_down)
        repeat.append(max(2 * s_up + 2 * s_down + abs(m_up - m_down), 4 * s_up, 4 * s_down))
    every = [m for pair in means for m in pair]
    middle = [(a + b) / 2 for a, b in means]
    return {
        "A": max(most) - min(least),
        "R": max(repeat),
        "E": max(every) - min(every),
        "M": max(middle) - min(middle),
        "B": max(abs(b) for b in reversals),
    }


@pytest.mark.parametrize("seed", range(20))
def test_iso_230_2(seed: int) -> None:
    deviations = planted(seed)
    found = axis_accuracy(TARGETS, deviations)
    for name, value in by_the_standard(deviations).items():
        assert getattr(found, name) == pytest.approx(value, rel=1e-9), name
    for side, (a, r, e) in enumerate((found.forward, found.backward)):
        one = by_the_standard(tuple((pair[side], pair[side]) for pair in deviations))
        assert (a, e) == pytest.approx((one["A"], one["E"]), rel=1e-9)
        assert r == pytest.approx(max(4 * statistics.stdev(float(v) for v in p[side]) for p in deviations), rel=1e-9)


def test_too_few_approaches_or_targets_have_no_figures() -> None:
    with pytest.raises(ValueError):
        axis_accuracy(TARGETS, planted(1, approaches=4))
    with pytest.raises(ValueError):
        axis_accuracy(TARGETS[:4], planted(1)[:4])


@pytest.mark.parametrize("even", [True, False])
@pytest.mark.parametrize("radius", [1e-3, 0.1, 2.0])
def test_circle_of_known_form(radius: float, even: bool) -> None:
    """An ellipse that is almost a circle, about any centre; the closed form where points are even."""
    angle = np.arange(400) * np.pi / 200 if even else np.sort(RNG.uniform(0, 2 * np.pi, 400))
    wave, out = 1e-4 * radius, 3e-5 * radius
    r = radius + out + wave * np.cos(2 * angle)
    path = np.column_stack([0.3 + r * np.cos(angle), -0.2 + r * np.sin(angle)])
    found = circle_deviation(path, radius)
    centre = _least_squares_centre(path)
    radii = np.hypot(*(path - centre).T)
    assert found.circular == pytest.approx(np.ptp(radii), rel=1e-6)
    assert found.largest == pytest.approx(radii.max() - radius, rel=1e-6)
    assert found.smallest == pytest.approx(radii.min() - radius, rel=1e-6, abs=1e-12 * radius)
    if even:
        assert found.circular == pytest.approx(2 * wave, rel=1e-3)  # but for squares of the wave


def _least_squares_centre(path: Array) -> Array:
    """By Newton steps on the sum of squares of radii about their mean, from the mean point."""
    centre = path.mean(axis=0)
    for _ in range(200):
        away = path - centre
        radii = np.hypot(*away.T)
        slopes = -away / radii[:, None]
        slopes = slopes - slopes.mean(axis=0)
        step = np.linalg.lstsq(slopes, -(radii - radii.mean()), rcond=None)[0]
        centre = centre + step
    return np.asarray(centre)


def test_iso_9283() -> None:
    commanded, attained = np.array([0.1, 0.2, 0.3]), RNG.normal([0.10002, 0.19999, 0.3], 1e-5, (30, 3))
    found = pose_accuracy(attained, commanded)
    middle = [statistics.fmean(float(v) for v in column) for column in attained.T]
    lengths = [math.dist(row, middle) for row in attained.tolist()]
    assert found.accuracy == pytest.approx(math.dist(middle, commanded.tolist()), rel=1e-9)
    assert found.repeatability == pytest.approx(statistics.fmean(lengths) + 3 * statistics.stdev(lengths), rel=1e-9)
    with pytest.raises(ValueError):
        pose_accuracy(attained[:29], commanded)
