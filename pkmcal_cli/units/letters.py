"""Letters that look like digits."""

from __future__ import annotations

_DIGITS = str.maketrans({"O": "0", "o": "0", "l": "1", "I": "1"})


def digits_of(text: str) -> str:
    """The text with digits in the place of letters that look like them."""
    return text.translate(_DIGITS)
