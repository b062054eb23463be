"""Simulated noise: of the instruments' channels and of the drive readings."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from pkmcal_cli.base.errors import UsageError
from pkmcal_cli.base.rotation import Array
from pkmcal_cli.calibration.problem import stated_sigma
from pkmcal_cli.model.commanded import drive_sigma
from pkmcal_cli.model.model import Model
from pkmcal_cli.prediction import Rows
from pkmcal_cli.units.unit_text import parse_unit
from pkmcal_cli.workflow.amounts import amount

_HINT = 'give declared, none or a value such as "10 um", not negative'


@dataclass
class Noise:
    """Gaussian noise of channels (C,) and of drive readings (A,), SI.

    Every row draws the same numbers whatever happens to the other rows.
    """

    channels: Array
    drives: Array
    silent: Sequence[str]  # channels of declared noise that declare none
    generator: np.random.Generator
    model: Model | None = None  # whose statements hold, of growth with distance and of correlation

    @classmethod
    def of(cls, model: Model, text: str, seed: int) -> Noise:
        """`declared`, `none` or one value for all channels of its dimension. Raises UsageError."""
        channels, drives = np.zeros(len(model.channels)), np.zeros(len(model.actuators))
        silent: list[str] = []
        if text == "declared":
            sigma = np.array([c.sigma for c in model.channels])
            silent = [c.name for c, s in zip(model.channels, sigma, strict=True) if np.isnan(s)]
            channels = np.nan_to_num(sigma)
            drives = drive_sigma(model) / model.gains
        elif text != "none":
            dimensions = [parse_unit(c.unit).dimension for c in model.channels]
            value, unit = amount("--noise", text, fitting=tuple(dict.fromkeys(dimensions)))
            fits = [dimension == unit.dimension for dimension in dimensions]
            if not any(fits) or value < 0:
                raise UsageError(f"--noise: `{text}` fits no channel", hint=_HINT)
            channels[fits] = value
        stated = model if text == "declared" else None
        return cls(channels, drives, silent, np.random.default_rng(seed), stated)

    def draw(self, rows: Rows) -> tuple[Rows, Array]:
        """Where the drives really stand when they read `rows`, and the channels' noise (N, C), see `of_channels`."""
        count = len(rows)
        drawn = self.generator.normal(size=(count, len(self.drives) + len(self.channels)))
        moved = drawn[:, : len(self.drives)] * self.drives
        return rows.moved(moved), drawn[:, len(self.drives) :]

    def of_channels(self, drawn: Array, readings: Array) -> Array:
        """Noise (N, C) of readings (N, C) from standard normal numbers (N, C): as large, and as alike, as is stated."""
        if self.model is None:
            return drawn * self.channels
        sigma = np.nan_to_num(stated_sigma(self.model, readings))
        alike = np.eye(len(self.channels))
        for a, b, share in self.model.correlated:
            alike[a, b] = alike[b, a] = share
        return np.asarray(drawn @ np.linalg.cholesky(alike).T * sigma)
