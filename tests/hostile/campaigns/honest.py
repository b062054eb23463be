"""Honest campaigns: wrong guesses of ranges and sigma, which must not make a result implausible."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from tests.hostile.campaigns.planted import measured
from tests.hostile.campaigns.sheet import Sheet

_MACHINES = ("scissors", "triglide", "triglide-nonredundant", "biglide", "delta4")
_SIZES, _NOISES, _ROWS = (1.0, 2.0, 3.0), (0.5, 1.0, 1.5, 2.0), (12, 24, 40)


@dataclass(frozen=True)
class Honest:
    """Errors `size` times as large as the ranges say, noise `noise` times what is stated."""

    machine: str
    size: float
    noise: float
    table: Callable[[], Sheet]

    @property
    def name(self) -> str:
        """Unique."""
        return f"honest, {self.machine}, ranges {self.size:g} x, noise {self.noise:g} x"


HONEST = tuple(
    Honest(
        m, size, noise,
        lambda m=m, size=size, noise=noise, k=12 * a + 4 * b + c: measured(
            m, 100 + k, rows=max(_ROWS[k % 3], 24 if m == "delta4" else 0), size=size, noise=noise
        ),
    )
    for a, m in enumerate(_MACHINES) for b, size in enumerate(_SIZES) for c, noise in enumerate(_NOISES)
)  # fmt: skip
