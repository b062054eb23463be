"""Letters that look like digits."""

from __future__ import annotations

import re
from collections.abc import Callable

_DIGITS = str.maketrans({"O": "0", "o": "0", "l": "1", "I": "1"})
_NUMBER = re.compile(r"[+-]?[0-9]+(?:\.[0-9]*)?")


def _is_plain(text: str) -> bool:
    return _NUMBER.fullmatch(text) is not None


def digits_hint(text: str, is_number: Callable[[str], bool] = _is_plain) -> str | None:
    """The remedy for a text that is a number once such letters are digits."""
    digits = text.translate(_DIGITS)
    return f"write digits, not letters: `{digits}`" if digits != text and is_number(digits) else None
