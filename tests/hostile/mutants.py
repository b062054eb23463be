"""One-line mutants: `python -m tests.hostile.mutants [FIRST [COUNT]]` runs the named test of each on a copy.

A mutant is killed where its test fails. One whose text is no longer there exactly once, one whose test passes, and one
whose test cannot run at all are told, and the exit code is 1.
"""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Sequence
from pathlib import Path

from tests.hostile.engine_mutants import ENGINE
from tests.hostile.inference_mutants import INFERENCE
from tests.hostile.mutant_kinds import Mutant
from tests.hostile.reader_mutants import READER

ROOT = Path(__file__).resolve().parents[2]
MUTANTS: tuple[Mutant, ...] = (*ENGINE, *INFERENCE, *READER)
_LEFT_OUT = shutil.ignore_patterns("__pycache__", "reference", "*.svg")


def copied(folder: Path) -> None:
    """What tests need of the checkout."""
    for name in ("pkmcal_cli", "tests", "machines"):
        shutil.copytree(ROOT / name, folder / name, ignore=_LEFT_OUT)
    shutil.copy2(ROOT / "pyproject.toml", folder)


def changed(mutant: Mutant, text: str) -> str:
    """The text of its file with the mutant in it. Raises ValueError where it does not apply."""
    if text.count(mutant.old) != 1:
        raise ValueError(f"occurs {text.count(mutant.old)} times: {mutant.old}")
    return text.replace(mutant.old, mutant.new)


def _outcome(mutant: Mutant, folder: Path, number: int) -> str:
    """`killed`, or what else became of it."""
    file = folder / "pkmcal_cli" / mutant.file
    whole, status = file.read_text(encoding="utf-8"), file.stat()
    try:
        file.write_text(changed(mutant, whole), encoding="utf-8")
        os.utime(file, (status.st_atime, status.st_mtime + 10 * (number + 1)))  # else compiled code is taken for it
        command = [sys.executable, "-m", "pytest", "-x", "-q", "-p", "no:cacheprovider", *mutant.test.split()]
        environment = os.environ | {"PYTHONPATH": str(folder)}
        done = subprocess.run(command, cwd=folder, env=environment, capture_output=True, text=True, check=False)
    except ValueError as error:
        return f"does not apply: {error}"
    finally:
        file.write_text(whole, encoding="utf-8")
        os.utime(file, (status.st_atime, status.st_mtime))
    last = done.stdout.strip().rsplit("\n", 1)[-1]
    return {0: "SURVIVED", 1: "killed"}.get(done.returncode, f"test does not run: {last}")


def outcomes(mutants: Sequence[Mutant]) -> list[tuple[Mutant, str]]:
    """Every mutant with what became of it."""
    out = []
    with tempfile.TemporaryDirectory() as name:
        copied(Path(name))
        for number, mutant in enumerate(mutants):
            out.append((mutant, _outcome(mutant, Path(name), number)))
            print(f"{out[-1][1]}: {mutant.file}: {mutant.new!r} by {mutant.test}", flush=True)
    return out


def main(arguments: Sequence[str]) -> int:
    """Run all, or COUNT from FIRST on."""
    first, count = (*map(int, arguments), *(0, len(MUTANTS))[len(arguments) :])
    found = outcomes(MUTANTS[first : first + count])
    killed = sum(how == "killed" for _, how in found)
    print(f"{killed} of {len(found)} mutants killed")
    return int(killed < len(found))


if __name__ == "__main__":
    raise SystemExit(main(sys.argv[1:]))
