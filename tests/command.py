"""Running commands in tests: in process, or as a process of its own."""

from __future__ import annotations

import contextlib
import io
import json
import os
import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from pkmcal_cli import app
from tests.compiled_once import compiling_once
from tests.csv_tables import Table, read_table

ROOT = Path(__file__).resolve().parents[1]
MACHINES = ROOT / "machines"
TRIGLIDE = str(MACHINES / "triglide.yaml")
TRIGLIDE_DATA = str(MACHINES / "triglide.csv")
SCISSORS = str(MACHINES / "scissors.yaml")
SHOPFLOOR = str(MACHINES / "scissors-shopfloor.csv")
HANGPRINTER = str(MACHINES / "hangprinter.yaml")
HANGPRINTER_DATA = str(MACHINES / "hangprinter_2021-12-16.csv")
GRID = "x=200:700:4,y=200:350:3"
"""Twelve positions of the Triglide."""

EXIT_CODES = {0, 1, 2, 3, 4, 130}  # 70 is never expected


@dataclass(frozen=True)
class Done:
    """A command that has ended."""

    code: int
    out: str
    err: str

    @property
    def json(self) -> Any:
        """What stands on stdout, strictly read: no NaN, no Infinity."""
        return json.loads(self.out, parse_constant=_no_constant)


def timeless(text: str) -> str:
    """Without the lines that say when something was made."""
    return "\n".join(line for line in text.splitlines() if '"created": ' not in line)


def _no_constant(name: str) -> float:
    raise AssertionError(f"{name} in JSON")


def run(*arguments: str | Path, stdin: str | None = None) -> Done:
    """A command in this process."""
    texts = [str(a) for a in arguments]
    out, err, old = io.StringIO(), io.StringIO(), (sys.argv, sys.stdin)
    sys.argv = ["pkmcal", *texts]
    if stdin is not None:
        sys.stdin = io.TextIOWrapper(io.BytesIO(stdin.encode()))
    try:
        with contextlib.redirect_stdout(out), contextlib.redirect_stderr(err), compiling_once():
            code = app.run(texts)
    finally:
        sys.argv, sys.stdin = old
    return Done(code, out.getvalue(), err.getvalue())


def environment(**more: str) -> dict[str, str]:
    """Environment of a process: the package is found wherever it runs, compiled modules are kept."""
    kept = {k: v for k, v in os.environ.items() if k not in ("PYTHONDONTWRITEBYTECODE", "NO_COLOR", "FORCE_COLOR")}
    return kept | {"PYTHONPATH": str(ROOT)} | more


def process(*arguments: str | Path, stdin: str = "", cwd: Path = ROOT, **more: str) -> Done:
    """A command as a process; `more`: environment variables."""
    done = subprocess.run(
        [sys.executable, "-m", "pkmcal_cli", *map(str, arguments)],
        input=stdin, capture_output=True, text=True, cwd=cwd, env=environment(**more), timeout=300, check=False,
    )  # fmt: skip
    return Done(done.returncode, done.stdout, done.stderr)


def table(path: str | Path) -> Table:
    """A table that was written."""
    return read_table(path)


def column(path: str | Path, name: str) -> np.ndarray[Any, Any]:
    """One column of numbers."""
    return np.asarray(table(path).numbers[name])


def clean(done: Done) -> Done:
    """The result, after a look that it ended in a way that is documented."""
    assert done.code in EXIT_CODES, done.err
    assert "Traceback" not in done.err and "Warning" not in done.err
    assert done.code in (0, 1) or done.err.strip()
    return done
