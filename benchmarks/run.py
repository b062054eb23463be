"""Speed, as ratios measured side by side in one process on one thread.

`python -m benchmarks.run` prints the table; `--write` also writes docs/performance.md; `--quick` leaves out the
commands (cold start, a million rows); `--once` runs every line once with few rows, to see that all of them run, and
judges no time. OpenSees is compared where the package openseespy is installed
(`pip install .[benchmark]`).
"""

from __future__ import annotations

import argparse
import os
import platform
import sys
from collections.abc import Iterator, Sequence
from pathlib import Path

for _variable in ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ[_variable] = "1"  # before numpy is loaded

import numpy as np  # noqa: E402

from benchmarks import predictions, processes, program, sessions, steps, sweep  # noqa: E402
from benchmarks.timing import ONCE, Effort, Line  # noqa: E402

TARGET = Path(__file__).resolve().parents[1] / "docs" / "performance.md"
GROWTH = ("against", "sizes", "cost", "exponent", "note")
HEAD = ("quantity", "measured", "required", "met", "note")


def lines(effort: Effort, quick: bool) -> Iterator[Line]:
    """All lines of the table."""
    yield from steps.frames_against_bare(effort)
    yield from predictions.small_machines(effort)
    yield from steps.growth_lines(effort)
    yield from predictions.hexapod_lines(effort)
    yield from steps.against_other_program(effort)
    yield from predictions.triglide_lines(effort)
    yield program.calibration_line(effort)
    if not quick:
        yield from program.start_lines(effort)
        yield from program.loop_lines(effort)
        yield from program.million_lines(effort)
        yield from program.memory_lines(effort)
        yield from sessions.session_lines(effort)
        yield from processes.process_lines(effort)


def table(head: tuple[str, ...], found: Sequence[Line | sweep.Growth]) -> str:
    """A table in Markdown."""
    rows = [head, ("---",) * len(head), *(line.cells() for line in found)]
    return "\n".join("| " + " | ".join(cell.replace("|", "\\|") for cell in row) + " |" for row in rows)


def document(found: list[Line], grown: list[sweep.Growth], rounds: int) -> str:
    """docs/performance.md."""
    versions = f"Python {platform.python_version()}, numpy {np.__version__}, {platform.machine()}"
    return f"""# Speed

Written by `python -m benchmarks.run --write`; medians of {rounds} rounds. All cases of a line run in turn in one
process on one thread ({versions}). Times are processor times, so other programs on a busy computer do not affect them
much; but how much sooner two processes end is by the clock. `a : b` is the time of a divided by that of b; for
OpenSees this is the factor by which the engine is faster. A step is the assembly of the tangent and the solution at a
known pose, with geometric stiffness as a calibration takes it, for all rows of a chunk together. `bare` is the faster
of LAPACK's `posv` (with multipliers `sysv`) row by row and numpy's batched `gesv`, on the same matrices, already
assembled. OpenSees rebuilds its model for every configuration, from coordinates prepared beforehand, with the fastest
of its direct solvers; its displacements are compared with the engine's. Iterations per row count those of the rigid
pose and of the elastic equilibrium together. The first iterate of a fit is 0.1 mm from the solution in every
parameter, a later one 1 um.

{table(HEAD, found)}

## How the cost grows

Cost is the processor time of the whole task at each size. The exponent is the slope of the logarithms: 1 is linear, 0
does not grow. How a step grows with the unknowns is in the table above (chain, platform and gantry of beams). Large
tasks are measured on a part and multiplied, as the note says; one process does them on one thread.

{table(GROWTH, grown)}
"""


def main() -> int:
    """Measure, print, write; exit code 1 where a requirement is missed."""
    parser = argparse.ArgumentParser(description="Speed as ratios measured side by side.")
    parser.add_argument("--rounds", type=int, default=9, help="rounds of every comparison")
    parser.add_argument("--quick", action="store_true", help="leave out cold start and the million rows")
    parser.add_argument("--once", action="store_true", help="every line once, with few rows; no verdict")
    parser.add_argument("--write", action="store_true", help="write docs/performance.md")
    chosen = parser.parse_args()
    found = []
    for line in lines(ONCE if chosen.once else Effort(chosen.rounds), chosen.quick):
        found.append(line)
        print("  ".join(cell for cell in line.cells()[: 1 if chosen.once else None] if cell), flush=True)
    grown = []
    for growth in sweep.growths(ONCE if chosen.once else Effort(chosen.rounds)):
        grown.append(growth)
        print("  ".join(cell for cell in growth.cells()[: 1 if chosen.once else None] if cell), flush=True)
    if chosen.once:
        return 0
    if chosen.write:
        TARGET.parent.mkdir(exist_ok=True)
        TARGET.write_text(document(found, grown, chosen.rounds), encoding="utf-8")
    return 0 if all(line.met is not False for line in found) else 1


if __name__ == "__main__":
    sys.exit(main())
