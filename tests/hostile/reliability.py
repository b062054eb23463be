"""Figures of all checks: `python -m tests.hostile.reliability --run [NAME ...]` measures, `--write` makes the page.

What was measured is kept in `figures.json` beside this file, since some checks take hours; each row of the page names
the command that its figure comes from. Times and dates are left out: they are no figures of the checks.
"""

from __future__ import annotations

import json
import re
import subprocess
import sys
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from tests.command import ROOT, environment

FIGURES = Path(__file__).with_name("figures.json")
PAGE = ROOT / "docs" / "reliability.md"
_TIME = re.compile(r"[;,] (longest|in) [\d.]+ s\b")
_COUNT = re.compile(r"(^|: )\d+ of \d+ ")
_HEAD = """# Reliability

What was tried to make pkmcal fail, and what came of it. Each figure is the last output of the command beside it; parts
of all run with every `pytest`. `python -m tests.hostile.reliability --run NAME` runs one and keeps its figures,
`--write` makes this page. What follows for those who use it: [what you can rely on](promises.md).

| check | what must hold | command | figures |
| --- | --- | --- | --- |
"""
_TAIL = """
Number k of the fuzz is the same input on every computer; others: `python -m tests.hostile.fuzz N FIRST`. CI runs
20,000 tables, 7,000 machine files and 3,000 commands; the slow run of a million is
`python -m pytest -m slow tests/test_fuzz.py tests/test_command_fuzz.py`. Of that run the 600,000 tables and 300,000
machine files had no fault (commit 946bf629, longest 5.7 s), nor the 100,000 commands (commit e6866b06, longest 15 s).
The lowest versions are tried by hand, as `tests/hostile/floors.py` says.
"""


@dataclass(frozen=True)
class Check:
    """A check: what must hold; module below `tests.hostile` with arguments; how many last lines are its figures.

    most: most cases are enough, so the command may end with 1; lines are then those that count.
    """

    holds: str
    command: str
    lines: int = 1
    most: bool = False

    @property
    def words(self) -> list[str]:
        """The command after `python -m`."""
        return f"tests.hostile.{self.command}".split()


_FUZZ = (
    "mutated tables, machine files, parameter files and command lines: no traceback, no number but a plain second "
    "reader's, nothing above 20 s"
)
_DISK = (
    "every file operation of every writing command fails (killed, ENOSPC, EIO, no memory, disk full from then on): "
    "files whole, old or absent; no pair that does not belong together is accepted; no exit code 70"
)
_ATTACK = (
    "texts of attackers in every input: nothing is run, no process, no socket, no file opened for writing but the "
    "results or for reading but inputs and packages"
)
_NIST = "NIST StRD regressions through the fit itself, from both starts: four digits, or an honest status"
CHECKS: Mapping[str, Check] = {
    "fuzz": Check(_FUZZ, "fuzz 100000 100000", 3),
    "file operations": Check(_DISK, "file_operations"),
    "file operations, a part": Check("the same of three commands", "file_operations new schema simulate"),
    "attacks": Check(_ATTACK, "attacks"),
    "unit slips": Check("units that engineers confuse are warned of", "unit_slips", most=True),
    "slips": Check("slips by hand in machines and tables get the message that is expected", "slips.texts", most=True),
    "campaigns that lie": Check("none ends `converged`; no honest one is refused", "campaigns", 2),
    "NIST": Check(_NIST, "nist", most=True),
    "mutants": Check("one-line mutants of the package: each is killed by the test that it names", "mutants"),
}


def measured(check: Check) -> list[str]:
    """Its figures. Raises RuntimeError where the check fails."""
    done = subprocess.run([sys.executable, "-m", *check.words], cwd=ROOT, env=environment(), capture_output=True,
                          text=True, check=False)  # fmt: skip
    if done.returncode not in ((0, 1) if check.most else (0,)):
        raise RuntimeError(f"{check.command}: {done.stdout[-3000:]}{done.stderr[-1000:]}")
    lines = [_TIME.sub("", line) for line in done.stdout.strip().splitlines()]
    return [line for line in lines if _COUNT.search(line)] if check.most else lines[-check.lines :]


def kept() -> dict[str, list[str]]:
    """What was measured, by check."""
    found: dict[str, list[str]] = json.loads(FIGURES.read_text(encoding="utf-8")) if FIGURES.exists() else {}
    return found


def page(figures: Mapping[str, Sequence[str]]) -> str:
    """The text of the page."""
    rows = []
    for name, check in CHECKS.items():
        lines = figures.get(name)
        shown = "not measured" if not lines else "<br>".join(lines) if len(lines) < 5 else ", ".join(lines)
        rows.append(f"| {name} | {check.holds} | `python -m {' '.join(check.words)}` | {shown} |\n")
    return _HEAD + "".join(rows) + _TAIL


def main(arguments: Sequence[str]) -> int:
    """Run checks and keep their figures, or write the page."""
    if arguments[:1] == ["--run"]:
        for name in arguments[1:] or CHECKS:
            lines = measured(CHECKS[name])
            FIGURES.write_text(json.dumps(kept() | {name: lines}, indent=2, sort_keys=True) + "\n", encoding="utf-8")
            print(name, *lines, sep="\n  ", flush=True)
        return 0
    if arguments == ["--write"]:
        PAGE.write_text(page(kept()), encoding="utf-8")
        return 0
    print(__doc__)
    return 2


if __name__ == "__main__":
    raise SystemExit(main(sys.argv[1:]))
