"""Attacks through every input of every command, under an audit hook: `python -m tests.hostile.attacks [EVERY [FIRST]]`.

None may run what it says, start a process, open a socket, open a file for writing but the results, or for reading but
inputs and packages; none may take long, or end in any way but those that are documented. EVERY: one of so many.
"""

from __future__ import annotations

import os
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path

from tests.command import EXIT_CODES, MACHINES, run
from tests.hostile.attack_inputs import PLACES, Attack, attacks, base_files
from tests.hostile.guarded_run import MARK, Guard
from tests.hostile.page_scripts import active_parts

SLOWEST = 20.0  # s of processor time
MAY_NAME_FILES = ("option", "extends")
"""Places whose text is the name of a file that is read: what is asked for on the command line, and `extends`."""
_TOUCH = f"touch {MARK}"


@dataclass
class Figures:
    """Of all attacks: how commands ended, by exit code; their processor time; what was wrong; the longest, s."""

    codes: Counter[int] = field(default_factory=Counter)
    seconds: Counter[str] = field(default_factory=Counter)
    faults: list[str] = field(default_factory=list)
    longest: float = 0.0

    def text(self) -> str:
        """In two lines."""
        codes = ", ".join(f"{n} exit code {code}" for code, n in sorted(self.codes.items()))
        return (
            f"{self.codes.total()} attacks through {len(self.seconds)} commands and {len(PLACES)} places ({codes}); "
            f"{len(self.faults)} faults; longest {self.longest:.1f} s"
        )


def _said(text: str, folder: Path) -> str:
    return text.replace("TOUCH", _TOUCH).replace("MARK", MARK).replace("{o}", str(folder / "out"))


def attacked(attack: Attack, folder: Path, guard: Guard) -> tuple[int, float, list[str]]:
    """Exit code, seconds, and what was wrong."""
    inputs, out = folder / "in", folder / "out"
    for path in (*inputs.iterdir(), *out.iterdir()):
        if path.is_file():
            path.unlink()
    for name, text in (base_files() | dict(attack.files)).items():
        path = inputs / _said(name, folder)
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(_said(text, folder), encoding="utf-8", errors="surrogatepass")
    words = [_said(word, folder).replace("{i}", str(inputs)).replace("{m}", str(MACHINES)) for word in attack.words]
    guard.found.clear()
    start = time.process_time()
    guard.on = True
    try:
        done = run(*words)
    finally:
        guard.on = False
    took = time.process_time() - start
    trusted = attack.place in MAY_NAME_FILES
    wrong = [*(f for f in guard.found if not (trusted and f.endswith("for reading"))), *_left(folder)]
    if done.code not in EXIT_CODES or "Traceback" in done.err:
        wrong.append(f"exit code {done.code}: {done.err[-300:]}")
    if took > SLOWEST:
        wrong.append(f"takes {took:.1f} s")
    for page in out.rglob("*"):
        if page.suffix in (".html", ".svg"):
            wrong += active_parts(page.read_text(encoding="utf-8"))
    return done.code, took, wrong


def _left(folder: Path) -> Iterator[str]:
    """What attacks have left behind where nothing is to be written."""
    yield from (f"{path} was written" for path in folder.iterdir() if path.name not in ("in", "out", "work", "tmp"))
    yield from (f"work/{path.name} was written" for path in (folder / "work").iterdir())


def attacked_all(every: int = 1, first: int = 0) -> Figures:
    """All attacks, or one of `every`."""
    figures = Figures()
    with tempfile.TemporaryDirectory() as name:
        folder, here = Path(name).resolve(), os.getcwd()
        for each in ("in", "out", "work", "tmp"):
            (folder / each).mkdir()
        for warm in attacks(warm=True):  # modules, fonts
            attacked(warm, folder, _Off())  # type: ignore[arg-type]
        old, tempfile.tempdir = tempfile.tempdir, str(folder / "tmp")
        guard = Guard(read=(folder / "in", MACHINES.parent), written=(folder / "out", folder / "tmp"))
        os.chdir(folder / "work")
        try:
            for attack in list(attacks())[first::every]:
                code, took, wrong = attacked(attack, folder, guard)
                figures.codes[code] += 1
                figures.seconds[attack.words[0]] += took
                figures.longest = max(figures.longest, took)
                figures.faults += [f"{attack.place}, {' '.join(attack.words)[:150]!r}: {fault}" for fault in wrong]
        finally:
            os.chdir(here)
            tempfile.tempdir = old
    return figures


class _Off:
    """In place of a guard, before there is one."""

    on, found = False, list[str]()


def main(arguments: Sequence[str]) -> int:
    """The figures."""
    every, first = (*map(int, arguments), *(1, 0)[len(arguments) :])
    figures = attacked_all(every, first)
    print(figures.text(), *figures.faults[:40], sep="\n")
    return int(bool(figures.faults))


if __name__ == "__main__":
    raise SystemExit(main(sys.argv[1:]))
