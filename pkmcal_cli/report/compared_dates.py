"""Of which time parameter files are that `compare` compares, in words."""

from __future__ import annotations

from collections.abc import Sequence

from pkmcal_cli.loading.known_parameters import KnownParameters
from pkmcal_cli.report.compared_effects import letter
from pkmcal_cli.report.sentences import listed

_LISTED = 12
_ORDER = "changes are told from the first to the last, in the order given"
_REMEDY = "; for changes per day, write the dates of the measurements as `created:` in `provenance:`"


def date_text(known: KnownParameters) -> str:
    """When it was measured, or made where that is not known."""
    if known.date is None:
        return "no date"
    return f"{known.date:%Y-%m-%d %H:%M}" if known.measured is None else f"measured {known.date:%Y-%m-%d %H:%M}"


def date_notes(known: Sequence[KnownParameters], days: float) -> list[str]:
    """What is to be said of a trend by dates that are `days` apart, 0 where the order of the files counts."""
    made = [letter(i) for i, k in enumerate(known) if k.measured is None]
    if not days:
        how, remedy = ("calculated", _REMEDY) if made else ("measured", "")
        return [f"these files were {how} within a day: {_ORDER}{remedy}"]
    if len(made) in (0, len(known)):
        return []
    return [f"not all tables had dates: {listed(made, _LISTED)} by the date of the calculation (`created:`)"]
