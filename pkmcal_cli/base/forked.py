"""Calls in copies of this process, which have all that it has imported; where the system makes such copies safely.

A process that starts anew imports for most of a second first, as long as 14 calibrations of the Scissors take.
"""

from __future__ import annotations

import os
import signal
import sys
from collections.abc import Callable, Generator, Iterator
from concurrent.futures import FIRST_COMPLETED, Future, ProcessPoolExecutor, wait
from itertools import islice
from multiprocessing import active_children, get_context, parent_process
from multiprocessing.connection import wait as ready
from threading import Thread
from typing import TypeVar

Part = TypeVar("Part")
Result = TypeVar("Result")
_AHEAD = 2  # calls for each process: one that it does, and the next

POSSIBLE = sys.platform == "linux"
"""Elsewhere what system libraries keep (threads, locks) does not outlive a copy, or there are none."""


def in_copies(call: Callable[[Part], Result], parts: Iterator[Part], jobs: int) -> Generator[Result, None, None]:
    """Results of calls, as they are there; parts are taken when a process is free for one. Raises what a call raises,
    and BrokenExecutor where a process is lost.

    Who stops asking does not wait for calls that go on: their processes are ended.
    """
    before = set(active_children())
    pool = ProcessPoolExecutor(jobs, get_context("fork"), initializer=_undisturbed)
    running: set[Future[Result]] = set()
    try:
        while True:
            running |= {pool.submit(call, part) for part in islice(parts, _AHEAD * jobs - len(running))}
            if not running:
                return
            done, running = wait(running, return_when=FIRST_COMPLETED)
            for future in done:
                yield future.result()
    finally:
        for process in set(active_children()) - before if running else ():
            process.terminate()
        pool.shutdown(cancel_futures=True)


def _undisturbed() -> None:
    """A Ctrl-C is for the process that this one works for, which ends it by a signal, or by ending itself."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    signal.signal(signal.SIGTERM, signal.SIG_DFL)
    Thread(target=_end_with_parent, daemon=True).start()


def _end_with_parent() -> None:
    """Wait until the process that this one is a copy of is no more: nobody else would ever end this one."""
    parent = parent_process()
    if parent is not None:
        ready([parent.sentinel])
        os._exit(1)
