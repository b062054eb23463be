"""One-line mutants: `python -m tests.hostile.mutants [FIRST [COUNT]]` runs the named test of each on a copy.

A mutant is killed where its test fails. One whose text is no longer there exactly once, one whose test passes, and one
whose test cannot run at all are told, and the exit code is 1.
"""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path

from tests.hostile.engine_mutants import ENGINE
from tests.hostile.inference_mutants import INFERENCE
from tests.hostile.mutant_kinds import Mutant
from tests.hostile.reader_mutants import READER

Runner = Callable[[Sequence[str]], int]
ROOT = Path(__file__).resolve().parents[2]
MUTANTS: tuple[Mutant, ...] = (*ENGINE, *INFERENCE, *READER)
_RUNNER = """
import json, os, sys
import hypothesis, numpy, pydantic, pytest, rich, scipy.linalg, scipy.special, yaml

for line in sys.stdin:
    sys.stdout.flush()
    child = os.fork()
    if not child:
        said = os.open("said", os.O_WRONLY | os.O_CREAT | os.O_TRUNC)
        os.dup2(said, 1), os.dup2(said, 2)
        code = pytest.main(json.loads(line))
        sys.stdout.flush()
        os._exit(code)
    print(os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]), flush=True)
"""
"""Imports what no mutant changes, and forks for every line, a list of pytest's arguments: its exit code is printed."""
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


@contextmanager
def _runner(folder: Path) -> Iterator[Runner]:
    """A process that runs tests of the copy in `folder`."""
    environment = os.environ | {"PYTHONPATH": str(folder), "OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1"}
    command, pipe = [sys.executable, "-c", _RUNNER], subprocess.PIPE
    with subprocess.Popen(command, cwd=folder, env=environment, stdin=pipe, stdout=pipe, text=True) as running:
        assert running.stdin is not None and running.stdout is not None
        asked, told = running.stdin, running.stdout

        def run(tests: Sequence[str]) -> int:
            print(json.dumps(["-x", "-q", "-p", "no:cacheprovider", *tests]), file=asked, flush=True)
            return int(told.readline())

        yield run


def _outcome(mutant: Mutant, folder: Path, number: int, run: Runner) -> str:
    """`killed`, or what else became of it."""
    file = folder / "pkmcal_cli" / mutant.file
    whole, status = file.read_text(encoding="utf-8"), file.stat()
    try:
        file.write_text(changed(mutant, whole), encoding="utf-8")
        os.utime(file, (status.st_atime, status.st_mtime + 10 * (number + 1)))  # else compiled code is taken for it
        code = run(mutant.test.split())
    except ValueError as error:
        return f"does not apply: {error}"
    finally:
        file.write_text(whole, encoding="utf-8")
        os.utime(file, (status.st_atime, status.st_mtime))
    last = (folder / "said").read_text(encoding="utf-8").strip().rsplit("\n", 1)[-1]
    return {0: "SURVIVED", 1: "killed"}.get(code, f"test does not run: {last}")


def outcomes(mutants: Sequence[Mutant]) -> list[tuple[Mutant, str]]:
    """Every mutant with what became of it."""
    out = []
    with tempfile.TemporaryDirectory() as name, _runner(Path(name)) as run:
        copied(Path(name))
        for number, mutant in enumerate(mutants):
            out.append((mutant, _outcome(mutant, Path(name), number, run)))
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
