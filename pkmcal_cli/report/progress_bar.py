"""Where a long work has come to, on one line of a terminal that is taken away again: step, bar, remaining time."""

from __future__ import annotations

import os
import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING

from pkmcal_cli.base.stages import Observer, Stage
from pkmcal_cli.base.visible import in_line

if TYPE_CHECKING:
    from rich.console import Console

_MINUTE = 60.0
_AFTER = 1.0  # s: what ends sooner needs no bar


def shown_on(console: Console, quiet: bool) -> bool:
    """Whether somebody can watch: stderr is a terminal that can move its cursor, whatever else says so."""
    return not quiet and sys.stderr.isatty() and not console.is_dumb_terminal and os.environ.get("TERM") is not None


@contextmanager
def progress_bar(console: Console) -> Iterator[Observer]:
    """An observer that shows the steps which it is told, if the work takes longer than a second.

    The line goes when the work ends, however it ends.
    """
    from rich.progress import BarColumn, Progress, TextColumn

    columns = TextColumn("{task.description}"), BarColumn(bar_width=20), TextColumn("{task.fields[left]}")
    clock = Clock()
    shown = Progress(*columns, console=console, transient=True)
    task = shown.add_task("", total=None, left="")

    def observe(stage: Stage) -> None:
        counted = counted_of(stage)
        done, total = (0, None) if counted is None else (counted.done, counted.total)
        shown.update(task, description=words(stage), completed=done, total=total, left=clock.left(counted))

    timer = threading.Timer(_AFTER, shown.start)
    timer.daemon = True
    timer.start()
    try:
        yield observe
    finally:
        timer.cancel()
        timer.join()
        shown.stop()


def words(stage: Stage) -> str:
    """The steps, the largest first: `rotation 2 of 5, search: step 3`."""
    return in_line(", ".join(_words(part) for part in stage.whole))


def _words(stage: Stage) -> str:
    if stage.total is not None:
        return f"{stage.name} {min(stage.done + 1, stage.total)} of {stage.total}"
    return f"{stage.name}: step {stage.done}" if stage.done else stage.name


def counted_of(stage: Stage) -> Stage | None:
    """The largest step of which is known how much there is; None without one."""
    return next((part for part in stage.whole if part.total is not None), None)


class Clock:
    """How long the rest of a step takes if it goes on as it has begun."""

    def __init__(self, seconds: Callable[[], float] = time.monotonic) -> None:
        self._clock, self._name, self._begun = seconds, "", 0.0

    def left(self, stage: Stage | None) -> str:
        """In words; "" while nobody can know, as nothing is done."""
        name = "" if stage is None else stage.name
        if name != self._name:
            self._name, self._begun = name, self._clock()
        if stage is None or stage.total is None or not stage.done:
            return ""
        seconds = (self._clock() - self._begun) / stage.done * (stage.total - stage.done)
        return f"about {seconds:.0f} s left" if seconds < 2 * _MINUTE else f"about {seconds / _MINUTE:.0f} min left"
