"""The page of the look-alikes: what was drawn, what became of it, and every case that falls short."""

from __future__ import annotations

from collections.abc import Sequence

from tests.lookalikes.judge import Judged
from tests.lookalikes.scenarios import SCENARIOS

HEAD = """# Look-alikes of real campaigns

Written by `python -m tests.lookalikes > docs/look-alikes.md`; do not edit.

Simulated campaigns that look like tables that people brought: real machines, few or many rows, noise with tails a
little heavier than normal (Student's t, 8 degrees of freedom), readings in whole counts, sessions of unequal length,
time that goes with temperature. The simulators (`tests/truth/look_alikes`) share no code with the engine; with all true
values declared, engine and simulator agree (`tests/test_look_alikes.py`). Every table is diagnosed as `pkmcal diagnose`
does it.

- **named**: every cause is among the findings. **in set**: every cause is found, or in the 95 % set of a finding; of
  `odd-rows` both wrong rows are told as well.
- **lone wrong**: a finding that is no cause, stands alone in its set, and is not called provisional.
- **held-out**: rms of fresh rows of the same day (measured like the table) by what was found, over that by the machine
  with the causes declared from the start, wrong rows left out; the worst seed. **against the truth**: the same rows
  without noise, which leaves what parameters and effects are off alone; no target.
- **seconds**: processor time of a diagnosis, mean.
- **good rows**: rows that are told to be wrong, and are not.

Required of 20 seeds each: in set 133 of 140, none below 16 of 20; lone wrong 0; held-out at most 1.15.
"""
FEWEST, SHARE, LARGEST = 16, 133 / 140, 1.15


def document(results: Sequence[Judged]) -> str:
    """All of it."""
    parts = [HEAD, *_lines("## Results", results), "", *_lines_of_short(results)]
    return "\n".join(parts) + "\n"


def _lines(title: str, results: Sequence[Judged]) -> list[str]:
    heads = (
        "scenario",
        "seeds",
        "named",
        "in set",
        "lone wrong",
        "held-out",
        "against the truth",
        "good rows",
        "seconds",
    )
    lines = [title, "", f"| {' | '.join(heads)} |", f"|{' --- |' * len(heads)}"]
    for name in dict.fromkeys(r.scenario for r in results):
        lines.append(_line(f"`{name}`: {SCENARIOS[name].words}", [r for r in results if r.scenario == name]))
    return [*lines, _line("all", results)]


def _line(title: str, mine: Sequence[Judged]) -> str:
    cells = (
        title,
        len(mine),
        sum(r.named for r in mine),
        sum(r.held for r in mine),
        sum(len(r.lone) for r in mine),
        f"{max(r.ratio for r in mine):.2f}",
        f"{max(r.true_after / r.true_declared for r in mine):.2f}",
        sum(r.lost for r in mine),
        f"{sum(r.seconds for r in mine) / len(mine):.1f}",
    )
    return f"| {' | '.join(map(str, cells))} |"


def _lines_of_short(results: Sequence[Judged]) -> list[str]:
    """Every case that falls short."""
    short = [r for r in results if not r.held or r.lone or r.ratio > LARGEST]
    if not short:
        return ["No case falls short."]
    lines = [
        "## What falls short",
        "",
        "| scenario | seed | verdict | found (set) | held-out |",
        "| --- | --- | --- | --- | --- |",
    ]
    return lines + [
        f"| {r.scenario} | {r.seed} | {r.verdict} | {'; '.join(r.found) or '-'} | {r.ratio:.2f} |" for r in short
    ]
