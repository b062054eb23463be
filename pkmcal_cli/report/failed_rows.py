"""Rows that nothing predicts: counted and named, in words and for JSON."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

from pkmcal_cli.base.errors import BadInput, Fault, Location
from pkmcal_cli.base.listener import Listener
from pkmcal_cli.base.plural import count
from pkmcal_cli.loading.poses import RowOrigin

_SHOWN = 20  # rows told one by one
_LISTED = 1000  # rows in the JSON
GRID_POINT = "grid point"


def place_json(row: RowOrigin) -> dict[str, Any]:
    """Where a row stands, for JSON."""
    return {"file": row.file, "line": row.line or None, "id": row.id or None}


@dataclass(frozen=True)
class FailedRows:
    """Why rows of a table of `total` rows have no prediction and are not used, by row; row_origin: where one stands."""

    reasons: Mapping[int, str]
    row_origin: Callable[[int], RowOrigin]
    total: int

    def show(self, to: Listener) -> None:
        """A warning for each of the first ones, and how many there are."""
        rows = sorted(self.reasons)
        for row in rows[:_SHOWN]:
            row_origin = self.row_origin(row)
            to.warn(f"warning: {row_origin}: {self.reasons[row]}: not used", row_origin.location)
        if rows:
            to.warn(f"warning: {len(rows)} of {count(self.total, 'row')} {'is' if len(rows) == 1 else 'are'} not used")

    def json(self) -> dict[str, Any]:
        """The same for JSON; so many rows at most are listed."""
        places = [(self.row_origin(row), self.reasons[row]) for row in sorted(self.reasons)[:_LISTED]]
        listed = [place_json(p) | {"reason": why} for p, why in places]
        return {"n_failed": len(self.reasons), "failed": listed}


@dataclass(frozen=True)
class SkippedPoints(FailedRows):
    """Points of a grid that are not used: a grid may well be larger than what the machine reaches.

    noun: what one of them is called.
    """

    noun: str = GRID_POINT

    def show(self, to: Listener) -> None:
        """How many there are, by reason. Raises BadInput where none is left."""
        for line in skipped(Counter(self.reasons.values()), self.total, self.noun):
            to.warn(line)


def skipped(by_reason: Mapping[str, int], total: int, noun: str = GRID_POINT) -> list[str]:
    """Points of a grid of `total` that are not used, a line for each reason. Raises BadInput where none is left."""
    points = count(total, noun)
    if sum(by_reason.values()) == total:
        reasons = "; ".join(f"{reason} ({n})" for reason, n in by_reason.items())
        message = f"none of {points} can be used: {reasons}"
        raise BadInput([Fault("grid", message, Location("--grid") if noun == GRID_POINT else None, _remedy(by_reason))])
    return [f"skipped: {n} of {points}: {reason}" for reason, n in by_reason.items()]


def _remedy(by_reason: Mapping[str, int]) -> str:
    """What to do where no point of a grid can be used: of a grid that is all right, its limits are not the cause."""
    if all(reason.startswith("no set values within all limits") for reason in by_reason):
        return "limits leave no room at any point: raise `force_limit`, lower `t_min` or widen the travel"
    if any(reason.startswith("no set values found: slack ropes") for reason in by_reason):
        return "with `--redundant min-force` or `min-energy` no rope is slack; state `t_min` of the ropes"
    return "check the limits of the grid and their units; a grid around the reference configuration has points"
