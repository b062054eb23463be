"""Noise that grows over the workspace, in words."""

from __future__ import annotations

from pkmcal_cli.diagnosis.noise_growth import DISTANCE, NoiseGrowth
from pkmcal_cli.report.number_format import uncertain


def growth_text(noise: NoiseGrowth) -> str:
    """Noise that grows: where to, how much, and what was made of it."""
    ratio = f"{uncertain(noise.ratio, noise.ratio_std)} times as large at the far end"
    if noise.towards != DISTANCE:
        return f"noise of {noise.sensor} grows towards {noise.towards}: {ratio}; rows are weighted by it"
    slope = uncertain(1e6 * noise.slope, 1e6 * noise.slope_std, "um/m")
    return f"noise of {noise.sensor} grows with distance: {slope} beyond sigma, {ratio}; rows are weighted by it"
