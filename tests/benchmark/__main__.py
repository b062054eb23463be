"""Draws, diagnoses and judges all cases, and prints the document.

`python -m tests.benchmark > docs/diagnosis-benchmark.md`; `--only TEST` (repeatable), `--cases N` (of each test at
most), `--share 0.25`, `--processes N`, `--raw FILE` (results as JSON lines), `--from FILE` (the document of results
that are there already; repeatable), `--note TEXT`.
"""

from __future__ import annotations

import argparse
import json
import math
import os
import sys
from collections.abc import Iterable, Iterator
from concurrent.futures import ProcessPoolExecutor
from dataclasses import asdict
from pathlib import Path

from tests.benchmark.cases import TESTS, case
from tests.benchmark.document import document
from tests.benchmark.judge import Result, judged


def arguments() -> argparse.Namespace:
    """The command line."""
    parser = argparse.ArgumentParser(prog="python -m tests.benchmark", description=__doc__.split("\n")[0])
    parser.add_argument("--only", action="append", choices=list(TESTS), help="a test; repeatable")
    parser.add_argument("--cases", type=int, help="cases of each test, at most")
    parser.add_argument("--share", type=float, default=1.0, help="share of the cases of each test")
    parser.add_argument("--processes", type=int, default=os.cpu_count(), help="worker processes")
    parser.add_argument("--raw", type=Path, help="file for the results, JSON lines")
    parser.add_argument("--from", dest="old", type=Path, action="append", help="results of earlier runs; repeatable")
    parser.add_argument("--note", default="", help="a sentence about this run, for the document")
    return parser.parse_args()


def one(key: tuple[str, int]) -> Result:
    """Draws, diagnoses and judges a case."""
    return judged(case(*key))


def run(keys: list[tuple[str, int]], processes: int) -> Iterator[Result]:
    """Results in the order of the keys."""
    if processes == 1:
        yield from map(one, keys)
        return
    with ProcessPoolExecutor(processes) as pool:
        yield from pool.map(one, keys, chunksize=4)


def kept(results: Iterable[Result], raw: Path | None) -> Iterator[Result]:
    """The results, each written as a line as it comes."""
    if raw is None:
        yield from results
        return
    with raw.open("w", encoding="utf-8") as file:
        for result in results:
            print(json.dumps(asdict(result)), file=file, flush=True)
            yield result


def main() -> None:
    """Runs and prints the document."""
    given = arguments()
    if given.old:
        lines = [line for file in given.old for line in file.read_text(encoding="utf-8").splitlines()]
        results = [Result(**json.loads(line)) for line in lines]
    else:
        limit = math.inf if given.cases is None else given.cases
        chosen = given.only or list(TESTS)
        counts = {t: int(min(math.ceil(TESTS[t][0] * given.share), limit)) for t in chosen}
        keys = [(t, n) for t, count in counts.items() for n in range(count)]
        results = list(kept(run(keys, given.processes), given.raw))
    sys.stdout.write(document(results, given.note))


if __name__ == "__main__":
    main()
