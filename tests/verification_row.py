"""A line of docs/verification.md, and whether what was measured is what must be."""

from __future__ import annotations

import re
from decimal import Decimal
from typing import NamedTuple

_NUMBER = r"-?\d+(?:\.\d+)?(?:e[+-]?\d+)?"
_FORMS = {
    "shown": "shown",
    "below": rf"< ({_NUMBER})",
    "above": rf"> ({_NUMBER})",
    "between": rf"({_NUMBER}) to ({_NUMBER})",
    "share": rf"({_NUMBER}) \(({_NUMBER}) %\)",
    "within": rf"({_NUMBER}) \+- ({_NUMBER})",
    "digits": rf"({_NUMBER})",
    "words": r"`(.+)`",
}
"""How a requirement is written; `shown` is a number for which nothing is required, beside one that must hold."""


class Row(NamedTuple):
    """One line of the table: what is shown, what it must be, the measured number (or text that begins with one)."""

    name: str
    required: str
    measured: float | str

    @property
    def text(self) -> str:
        """The measured number as the page shows it."""
        return self.measured if isinstance(self.measured, str) else f"{self.measured:.5g}"

    @property
    def line(self) -> str:
        """The line in Markdown."""
        return f"| {self.name} | {self.required} | {self.text} |"


def read(line: str) -> Row:
    """A line of the page."""
    name, required, measured = (cell.strip() for cell in line.strip().strip("|").split(" | "))
    return Row(name, required, measured)


def holds(row: Row) -> bool:
    """Whether the number on the page is what must be. Raises ValueError for a requirement of no known form.

    `60.06`: to the digits given; `4.96 (3 %)`, `1 +- 0.03`: within; words in back-ticks: these words.
    """
    form, bounds = _form(row.required)
    if form == "words":
        return row.text == bounds[0]
    found = re.match(_NUMBER, row.text)
    if found is None:
        raise ValueError(f"no number: {row}")
    value, numbers = float(found[0]), [float(b) for b in bounds]
    if form == "digits":
        return round(Decimal(row.text), -int(Decimal(bounds[0]).as_tuple().exponent)) == Decimal(bounds[0])
    return {
        "shown": lambda: True,
        "below": lambda: value < numbers[0],
        "above": lambda: value > numbers[0],
        "between": lambda: numbers[0] <= value <= numbers[1],
        "share": lambda: abs(value - numbers[0]) <= numbers[1] / 100 * abs(numbers[0]),
        "within": lambda: abs(value - numbers[0]) <= numbers[1],
    }[form]()


def _form(required: str) -> tuple[str, tuple[str, ...]]:
    for form, pattern in _FORMS.items():
        if found := re.fullmatch(pattern, required):
            return form, found.groups()
    raise ValueError(f"no known form: {required}")
