"""Rows that nothing predicts: counted and named, in words and for JSON."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

from pkmcal_cli.base.plural import count
from pkmcal_cli.loading.poses import Place
from pkmcal_cli.report.console import Reporter

_SHOWN = 20  # rows told one by one


@dataclass(frozen=True)
class FailedRows:
    """Why rows of a table of `total` rows have no prediction and are not used, by row; `place`: where a row stands."""

    reasons: Mapping[int, str]
    place: Callable[[int], Place]
    total: int

    def show(self, to: Reporter) -> None:
        """A warning for each of the first ones, and how many there are."""
        rows = sorted(self.reasons)
        for row in rows[:_SHOWN]:
            to.warn(f"warning: {self.place(row)}: {self.reasons[row]}: not used")
        if rows:
            have = "has no prediction and is" if len(rows) == 1 else "have no prediction and are"
            to.warn(f"warning: {len(rows)} of {count(self.total, 'row')} {have} not used")

    def json(self) -> dict[str, Any]:
        """The same for JSON."""
        places = [(self.place(row), self.reasons[row]) for row in sorted(self.reasons)]
        listed = [{"file": p.file, "line": p.line or None, "id": p.id or None, "reason": why} for p, why in places]
        return {"n_failed": len(listed), "failed": listed}
