"""Ticks of logarithmic axes: at least two, round, and not crowded."""

from __future__ import annotations

import pytest
from matplotlib.figure import Figure

from pkmcal_cli.pictures.parts import plain_log


@pytest.mark.parametrize(
    ("low", "high", "ticks"),
    [
        (19.3, 41.4, [20, 30]),
        (64.0, 104.0, [70, 100]),
        (4.9, 240.0, [5, 10, 20, 50, 100, 200]),
        (42.0, 47.0, [42, 43, 44, 45, 46, 47]),
        (36.0, 62.0, [40, 50, 60]),
    ],
)
@pytest.mark.parametrize("axis", ["x", "y"])
def test_short_ranges_have_few_round_ticks(low: float, high: float, ticks: list[float], axis: str) -> None:
    """Of 20 to 40 points the library's ten ran into each other; of 64 to 104 um one was left."""
    ax = Figure(figsize=(3, 3)).subplots()
    (ax.set_xlim if axis == "x" else ax.set_ylim)(low, high)
    plain_log(ax, axis)
    which = ax.xaxis if axis == "x" else ax.yaxis
    shown = [t for t in which.get_majorticklocs() if low <= t <= high]
    assert shown == pytest.approx(ticks)
