"""Texts of others on a terminal: what would move the cursor, colour, hide or reorder what it shows becomes visible."""

from __future__ import annotations

import unicodedata

_KEPT = "\n\t"
_UNSEEN = ("Cc", "Cf", "Cs", "Co", "Cn", "Zl", "Zp")  # control, format (also bidirectional), and what has no shape


def visible(text: str, kept: str = _KEPT) -> str:
    r"""The text with all that has no shape as escapes (`\x1b`, `\u202e`), but for line ends and tabs."""
    if text.isascii() and text.isprintable():
        return text
    return "".join(c if c in kept or not _is_unseen(c) else _escaped(c) for c in text)


def in_line(text: str) -> str:
    """The same of a name, which has no line end either."""
    return visible(text, kept="")


def json_safe(text: str) -> str:
    r"""A JSON text with the same as its own escapes (`\u001b`): the values are the same."""
    if text.isascii():  # JSON has no bare control characters but DEL
        return text.replace("\x7f", "\\u007f")
    return "".join(c if c == "\n" or not _is_unseen(c) else _pairs(c) for c in text)


def _is_unseen(c: str) -> bool:
    return unicodedata.category(c) in _UNSEEN


def _escaped(c: str) -> str:
    return c.encode("unicode_escape", "surrogatepass").decode("ascii")


def _pairs(c: str) -> str:
    """One escape of JSON, or two."""
    units = c.encode("utf-16-be", "surrogatepass").hex()
    return "".join(f"\\u{units[k : k + 4]}" for k in range(0, len(units), 4))
