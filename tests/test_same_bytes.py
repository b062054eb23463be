"""The same bytes for the same input, seed and versions: however many threads, and in whatever order sets are walked."""

from __future__ import annotations

import re

import pytest

from tests.command import MACHINES, process

_TIME = re.compile(r"\d{4}-\d\d-\d\d[T ]\d\d:\d\d:\d\d[.\d]*(Z|[+-]\d\d:\d\d)?")
_BOX = "x=300:600,y=200:300"


def written(command: str, threads: str, seed: str) -> str:
    words = command.replace("@", f"{MACHINES}/").split()
    limits = dict.fromkeys(("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS"), threads)
    done = process(*words, PYTHONHASHSEED=seed, **limits)
    assert done.code in (0, 1), done.err
    return _TIME.sub("TIME", done.out)


@pytest.mark.parametrize("command", [
    "simulate @triglide.yaml @triglide.csv --noise declared --seed 4",
    "diagnose @biglide.yaml @biglide.csv --json",  # differed in the last bits with two threads
])  # fmt: skip
def test_threads_and_hash_seed_change_no_byte(command: str) -> None:
    first, other = written(command, "1", "1"), written(command, "2", "2")
    assert first == other and len(first) > 100


@pytest.mark.slow
@pytest.mark.parametrize("command", [
    "plan @biglide.yaml --grid x=300:600:2,y=200:300:2 --points 2 -o -",
    f"study @biglide.yaml --points 5 --repeat 2 --validation 2 --within {_BOX} --json",
    "calibrate @triglide-nonredundant.yaml @triglide-nonredundant.csv --uncertainty bootstrap --json",
    "calibrate @hexapod7.yaml @hexapod7.csv --uncertainty bootstrap --json",
    "calibrate @scissors.yaml @scissors-shopfloor.csv --uncertainty profile --json",
    "improve @scissors.yaml @scissors-shopfloor.csv --json",
    "diagnose @scissors.yaml @scissors-shopfloor.csv --json",
    "plan @triglide.yaml --grid x=200:700:3,y=200:350:3 --points 3 -o -",
])  # fmt: skip
def test_nor_of_long_commands(command: str) -> None:
    assert written(command, "1", "1") == written(command, "2", "2")
