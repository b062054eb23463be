"""`python -m tests.page_outputs [PAGE.md ...]`: what the commands of the pages print, written anew into the pages.

Lines that a page leaves out ("...") stay left out: each run of shown lines goes where it is most like what is printed.
"""

from __future__ import annotations

import difflib
import os
import sys
import tempfile
from collections.abc import Sequence
from functools import cache
from pathlib import Path

from tests.command import MACHINES, ROOT
from tests.pages import OMITTED, SHOWING, all_files, commands, done, fits, output, write


def renewed(shown: Sequence[str], real: Sequence[str]) -> list[str]:
    """The shown lines as they are now printed."""
    if fits(shown, real):
        return list(shown)
    if OMITTED not in shown:
        return list(real)
    runs: list[list[str]] = [[]]
    for line in shown:
        if line == OMITTED:
            runs.append([])
        else:
            runs[-1].append(line)

    @cache
    def best(k: int, begin: int) -> tuple[float, tuple[int, ...]]:
        """How like the runs from k on are to the lines from `begin` on, and where they begin."""
        if k == len(runs):
            return 0.0, ()
        size = len(runs[k])
        places: Sequence[int] = range(begin, len(real) - size + 1)
        if k == 0:
            places = [0]
        elif k == len(runs) - 1:
            places = [len(real) - size] if len(real) - size >= begin else []
        options = []
        for at in places:
            like = sum(difflib.SequenceMatcher(None, a, b).ratio() for a, b in zip(runs[k], real[at:], strict=False))
            rest, where = best(k + 1, at + size)
            options.append((like + rest, (at, *where)))
        return max(options, default=(-1e9, ()))

    out: list[str] = []
    for k, (lines, at) in enumerate(zip(runs, best(0, 0)[1], strict=True)):
        out += ([OMITTED] if k else []) + list(real[at : at + len(lines)])
    return out


def main(pages: Sequence[str]) -> None:
    """Write the pages, or those named, with or without their folder; tell the commands whose output is another."""
    names, files = {Path(page).name for page in pages}, all_files()
    if unknown := names - {page.name for page in SHOWING}:
        raise SystemExit(f"no page that shows what commands print: {', '.join(sorted(unknown))}")
    for page in SHOWING:
        if names and page.name not in names:
            continue
        text = page.read_text(encoding="utf-8")
        for shown in list(commands(text)):
            with tempfile.TemporaryDirectory() as folder:
                (Path(folder) / "machines").symlink_to(MACHINES)
                (Path(folder) / "docs").symlink_to(ROOT / "docs")
                write(Path(folder), files)
                os.chdir(folder)
                real = output(done(shown.line))
                os.chdir(ROOT)
            now = renewed(shown.output, real)
            assert fits(now, real), shown.line
            if tuple(now) != shown.output:
                print(f"{page.name}: {shown.line}", file=sys.stderr)
                old = "\n".join([f"$ {shown.line}", *shown.output, ""])
                assert text.count(old) == 1, shown.line
                text = text.replace(old, "\n".join([f"$ {shown.line}", *now, ""]))
        page.write_text(text, encoding="utf-8")


if __name__ == "__main__":
    main(sys.argv[1:])
