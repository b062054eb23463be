"""What is off by more than noise, or by much less than the stated one, beside a calibration."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from pkmcal_cli.base.plural import count
from pkmcal_cli.loading.poses import RowOrigin
from pkmcal_cli.report.bench_text import BenchText
from pkmcal_cli.report.failed_rows import place_json


@dataclass(frozen=True)
class OddReadings:
    """Rows that the others contradict; bench readings that rows contradict; by channel, how many times too large its
    sigma is stated."""

    rows: tuple[RowOrigin, ...] = ()
    bench: tuple[BenchText, ...] = ()
    overstated: Mapping[str, float] = field(default_factory=dict)

    @property
    def texts(self) -> tuple[str, ...]:
        """Rows and bench readings as reasons for which a fit is incomplete."""
        n = len(self.rows)
        rows = f"{count(n, 'row')} {'is' if n == 1 else 'are'} far from what the other rows predict"
        return (*([rows] if n else []), *(each.text for each in self.bench))

    def json(self) -> dict[str, Any]:
        """Rows and bench readings for programs."""
        return {"far_rows": [place_json(row) for row in self.rows], "bench": [each.json() for each in self.bench]}
