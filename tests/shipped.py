"""The shipped machines and tables."""

from __future__ import annotations

import re
from pathlib import Path

from tests.command import MACHINES

TABLES = sorted(MACHINES.glob("*.csv"))


def machine_of(table: Path) -> Path:
    """The machine of a table, by its name: `NAME.csv`, `NAME-MORE.csv`, `NAME_MORE.csv`; the longest name counts."""
    machines = [f for f in MACHINES.glob("*.yaml") if "." not in f.stem]
    mine = [m for m in machines if re.match(rf"{re.escape(m.stem)}([-_][^/]*)?$", table.stem)]
    return max(mine, key=lambda m: len(m.stem))
