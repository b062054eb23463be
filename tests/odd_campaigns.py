"""Machines and tables with what is in no catalogue."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np

from tests.command import ROOT
from tests.truth.campaigns import Planted, Scenario, campaign, unit


def odd_field(folder: Path) -> list[str]:
    """A machine and a table with something smooth that is in no catalogue."""
    measured = campaign("delta4", [unit("delta4", "smooth_field", "tracker", 3).scaled(4)], 3)
    (folder / "field.csv").write_text(measured.csv_text())
    return [str(ROOT / "tests" / "benchmark" / "machines" / "delta4.yaml"), "field.csv"]


def growing_noise(folder: Path) -> list[str]:
    """A machine and a table whose noise grows with distance."""
    measured = campaign("delta4", [], 3)
    distance = np.sqrt((measured.true_readings**2).sum(axis=1, keepdims=True))
    noise = 3 * measured.sigma * (distance / np.median(distance)) ** 4
    rng = np.random.default_rng(1)
    (folder / "grown.csv").write_text(
        replace(measured, readings=measured.true_readings + noise * rng.normal(size=noise.shape)).csv_text()
    )
    return [str(ROOT / "tests" / "benchmark" / "machines" / "delta4.yaml"), "grown.csv"]


def odd_shape(folder: Path) -> list[str]:
    """A machine and a table in which one drive is off by a shape that is in no catalogue; without temperatures."""
    measured = campaign("scissors", [Planted("odd_tanh", "q2", {"h": 50e-6})], 1, scenario=Scenario(omit=("T",)))
    (folder / "shape.csv").write_text(measured.csv_text())
    return [str(ROOT / "tests" / "benchmark" / "machines" / "scissors.yaml"), "shape.csv"]
