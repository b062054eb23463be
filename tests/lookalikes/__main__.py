"""Draws, diagnoses and judges look-alikes of real campaigns, and prints their page.

`python -m tests.lookalikes > docs/look-alikes.md` (an hour on one core); `--seeds N` of each scenario (20), `--only
SCENARIO` (repeatable), `--raw FILE` (results as JSON lines), `--from FILE` (the page of results that are there already;
repeatable).
"""

from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Iterator
from dataclasses import asdict
from pathlib import Path

from tests.lookalikes.document import document
from tests.lookalikes.judge import Judged, judged
from tests.lookalikes.scenarios import SCENARIOS

SEEDS = 20


def arguments() -> argparse.Namespace:
    """The command line."""
    parser = argparse.ArgumentParser(prog="python -m tests.lookalikes", description=__doc__.split("\n")[0])
    parser.add_argument("--only", action="append", choices=list(SCENARIOS), help="a scenario; repeatable")
    parser.add_argument("--seeds", type=int, default=SEEDS, help="campaigns of each scenario")
    parser.add_argument("--raw", type=Path, help="file for the results, JSON lines")
    parser.add_argument("--from", dest="old", type=Path, action="append", help="results of earlier runs; repeatable")
    return parser.parse_args()


def run(names: list[str], seeds: int) -> Iterator[Judged]:
    """Results, scenario by scenario."""
    for name in names:
        for seed in range(seeds):
            yield judged(name, seed, SCENARIOS[name].draw(seed))


def main() -> None:
    """Runs and prints the page."""
    given = arguments()
    if given.old:
        lines = [line for file in given.old for line in file.read_text(encoding="utf-8").splitlines()]
        results = [Judged(**json.loads(line)) for line in lines]
    else:
        results = []
        raw = given.raw.open("w", encoding="utf-8") if given.raw else None
        for result in run(given.only or list(SCENARIOS), given.seeds):
            results.append(result)
            if raw:
                print(json.dumps(asdict(result)), file=raw, flush=True)
    sys.stdout.write(document(results))


if __name__ == "__main__":
    main()
