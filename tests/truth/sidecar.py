"""NAME.csv.provenance.yaml, which stands beside a table: whose content it is, by its sha256, and how it was made."""

from __future__ import annotations

import hashlib
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import yaml


def sidecar_of(table: Path) -> Path:
    """The file beside a table."""
    return table.with_name(f"{table.name}.provenance.yaml")


def sha256_of(table: Path) -> str:
    """Of its content, 64 hex digits."""
    return hashlib.sha256(table.read_bytes()).hexdigest()


def write_sidecar(table: Path, told: Mapping[str, Any]) -> None:
    """Writes it for a table that is there."""
    text = {"data": told["data"], "sha256": sha256_of(table), **told}
    with sidecar_of(table).open("w", encoding="utf-8") as file:
        yaml.safe_dump(text, file, sort_keys=False, width=100)
