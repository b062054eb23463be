"""Whose `--json` output is kept: every command on every shipped machine and table."""

from __future__ import annotations

import contextlib
import json
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from tests.command import ROOT, clean
from tests.computed_once import run_once
from tests.shipped import TABLES, machine_of

OUTPUTS = ROOT / "tests" / "reference"
QUICK = ("check", "effects", "sensitivity", "observability", "simulate", "correct")
LONG = {
    "calibrate": ("triglide", "scissors-shopfloor", "delta4", "hangprinter_2021-12-16", "belt-router"),
    "plan": ("triglide",),
    "diagnose": ("biglide", "scissors-shopfloor"),
    "improve": ("scissors-shopfloor",),
}
"""Commands that take long, and the tables on which CI compares them; they are slow on the others."""
LARGE = ("hexapod7", "gantry-bow", "hangprinter_2022-04-12", "scissors-strained")
"""Tables of which all is slow: machines and sensors like theirs are there, in smaller tables."""


@dataclass(frozen=True)
class Case:
    """A command on a table and its machine."""

    command: str
    table: Path

    @property
    def name(self) -> str:
        return f"{self.table.stem}.{self.command}"

    @property
    def file(self) -> Path:
        return OUTPUTS / f"{self.name}.json"

    @property
    def slow(self) -> bool:
        known = LONG.get(self.command)
        return self.table.stem in LARGE or (known is not None and self.table.stem not in known)

    def output(self, folder: Path) -> dict[str, Any]:
        """What the command prints with `--json`, without the provenance; files go into a folder."""
        machine, table = (str(f.relative_to(ROOT)) for f in (machine_of(self.table), self.table))
        arguments = [self.command, machine, *(() if self.command == "effects" else (table,)), "--json", "--quiet"]
        folder = folder / self.command
        folder.mkdir(exist_ok=True)
        if self.command in ("simulate", "correct", "improve"):
            arguments += ["-o", str(folder / f"{self.table.stem}{'.yaml' if self.command == 'improve' else '.csv'}")]
        with contextlib.chdir(ROOT):
            done = clean(run_once(*arguments))
        text = done.out.replace(f"{folder}/", "")
        found: dict[str, Any] = {"exit_code": done.code} | (json.loads(text) if text else {"refused": done.err})
        found.pop("provenance", None)
        return found


CASES = tuple(Case(command, table) for table in TABLES for command in (*QUICK, *LONG))
