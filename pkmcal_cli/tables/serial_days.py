"""Times that are no seconds: a spreadsheet's day numbers (44546.4375 is 2021-12-16 10:30), milliseconds, digits."""

from __future__ import annotations

from dataclasses import dataclass
from datetime import UTC, datetime, timedelta

import numpy as np

from pkmcal_cli.csv_files.cell_values import FloatArray
from pkmcal_cli.csv_files.dialect import Flaw

_FIRST, _LAST = 32_000.0, 62_000.0  # days since the end of 1899: 1987 to 2069
_LAST_SECOND = 1e11  # s since 1970: in the year 5138
_EPOCH = datetime(1899, 12, 30, tzinfo=UTC)
Span = tuple[datetime, datetime]
"""When the first and the last row were measured, UTC."""
_STEP = 0.5  # s: a campaign whose poses follow faster than this is none


@dataclass
class Times:
    """The times of a file so far: how many, the smallest and the largest, s."""

    count: int = 0
    least: float = np.inf
    most: float = -np.inf

    def add(self, times: FloatArray | None) -> None:
        """Take those of some rows (n,)."""
        known = np.zeros(0) if times is None else times[np.isfinite(times)]
        if len(known):
            self.count += len(known)
            self.least, self.most = min(self.least, float(known.min())), max(self.most, float(known.max()))

    def since(self, origin: float) -> Span | None:
        """By dates, of which these times are counted from `origin`, s since 1970; None without any."""
        if not self.count:
            return None
        return datetime.fromtimestamp(origin + self.least, UTC), datetime.fromtimestamp(origin + self.most, UTC)

    @property
    def days(self) -> Span | None:
        """By day numbers; None where these times do not look like such."""
        if self.count < 2 or not _FIRST <= self.least <= self.most <= _LAST:
            return None
        if self.most - self.least > _STEP * (self.count - 1) or self.most == self.least:
            return None
        return _EPOCH + timedelta(days=self.least), _EPOCH + timedelta(days=self.most)

    @property
    def _looks_like(self) -> str | None:
        """What times are that can hardly be seconds."""
        if self.days is not None:
            return f"{self.least:g} looks like a spreadsheet's day ({self.days[0]:%Y-%m-%d})"
        if self.count and self.least > _LAST_SECOND:
            return f"{self.least:.0f} looks like milliseconds since 1970, or like the digits of a date"
        return None

    def flaw(self, line: int, cell: int) -> Flaw | None:
        """What is to be said of the column, where its times look like no seconds."""
        if (looks_like := self._looks_like) is None:
            return None
        message = f"column `time` is read in seconds, but {looks_like}"
        return Flaw("csv-time", message, "write times as `2021-12-16T10:30`, or seconds since the start", line, cell)
