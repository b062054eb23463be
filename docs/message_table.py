"""What the codes of messages mean and what to do: the tables of docs/messages.md."""

from __future__ import annotations

from functools import cache
from pathlib import Path
from typing import Any

import yaml

from docs.message_codes import messages
from docs.model_tables import table

NEVER = {"error"}
"""Codes that stand for those that classes of errors set."""


_FILE = Path(__file__).parent / "message_meanings.yaml"


@cache
def _groups() -> dict[str, dict[str, Any]]:
    return dict(yaml.safe_load(_FILE.read_text(encoding="utf-8")))


def meanings() -> dict[str, tuple[str, str]]:
    """Cause and remedy, by code."""
    return {code: (told["cause"], told["remedy"]) for group in _groups().values() for code, told in group.items()}


def _meaning_table(group: str) -> str:
    known = meanings()
    return table(("code", "cause", "remedy"), [(f"`{code}`", *known[code]) for code in _groups()[group]])


def machine_messages() -> str:
    """Codes of faults of machine files."""
    return _meaning_table("machine")


def table_messages() -> str:
    """Codes of faults of tables."""
    return _meaning_table("table")


def result_messages() -> str:
    """All other codes."""
    return _meaning_table("result")


def message_texts() -> str:
    """The texts that stand in the source, with their codes, in order."""
    texts = sorted((text.replace("|", "\\|"), code) for code, those in messages().items() for text in those)
    return table(("text", "code"), [(text, f"`{code}`") for text, code in texts if any(c.isalpha() for c in text)])
