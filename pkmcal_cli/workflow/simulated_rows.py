"""What a simulation has come to: rows, those without a solution and why, the extent of what is read."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass, field

import numpy as np

from pkmcal_cli.base.rotation import Array
from pkmcal_cli.loading.poses import Poses, RowOrigin

_LISTED = 1000


@dataclass(kw_only=True)
class Tally:
    """What has been simulated so far."""

    seen: int = 0
    rows: int = 0
    n_failed: int = 0
    touched: int = 0
    failed: list[tuple[RowOrigin, str]] = field(default_factory=list)
    by_reason: Counter[str] = field(default_factory=Counter)
    outside: Counter[str] = field(default_factory=Counter)  # rows outside the knots of shapes without a name
    low: Array | None = None
    high: Array | None = None

    def add(self, values: Array) -> None:
        """Count rows and widen the extent of the channels."""
        self.rows += len(values)
        if len(values):
            low, high = np.nanmin(values, axis=0, initial=np.inf), np.nanmax(values, axis=0, initial=-np.inf)
            self.low = low if self.low is None else np.minimum(self.low, low)
            self.high = high if self.high is None else np.maximum(self.high, high)

    def fail(self, block: Poses, reasons: dict[int, str]) -> None:
        """Count rows without a solution; list the first ones."""
        self.n_failed += len(reasons)
        self.by_reason.update(reasons.values())
        room = _LISTED - len(self.failed)
        self.failed += [(block.row_origin(k), reasons[k]) for k in sorted(reasons)[: max(room, 0)]]
