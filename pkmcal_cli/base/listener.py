"""Who is told what a work has to say of its inputs while it runs: a terminal, or a record of it."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from contextlib import AbstractContextManager, contextmanager
from dataclasses import dataclass, field
from typing import Protocol

from pkmcal_cli.base.errors import Fault, Location
from pkmcal_cli.base.stages import Observer, Stage, unobserved

_WARNING = "warning: "


class Listener(Protocol):
    """Takes lines, notes, warnings, reasons of failure, and says who watches the progress."""

    def say(self, text: str = "") -> None:
        """A line."""

    def notes(self, notes: Iterable[str]) -> None:
        """Announcements."""

    def warn(self, finding: str | Fault, where: Location | None = None) -> None:
        """A warning; `where`: the place that a text is about."""

    def fail(self, finding: str | Fault, where: Location | None = None) -> None:
        """Why the verdict is negative; `where`: the place that a text is about."""

    def stages(self) -> AbstractContextManager[Observer]:
        """Who is told where a long work has come to."""

    def progress(self, step: str, total: int | None) -> AbstractContextManager[Callable[[int], None]]:
        """Who is told how many more of these are done, of how many; None where nobody knows."""

    def step(self, name: str) -> AbstractContextManager[None]:
        """A work of which nobody knows how long it is."""


@dataclass
class Record:
    """Keeps what was said, without the words that mark a warning; `observe`: who watches."""

    observe: Observer = unobserved
    lines: list[str] = field(default_factory=list)
    warnings: list[str] = field(default_factory=list)
    failures: list[str] = field(default_factory=list)

    def say(self, text: str = "") -> None:
        """A line; empty ones only part others."""
        if text:
            self.lines.append(text)

    def notes(self, notes: Iterable[str]) -> None:
        """Announcements."""
        self.lines += notes

    def warn(self, finding: str | Fault, where: Location | None = None) -> None:
        """A warning, or a note that is told like one."""
        text = _text(finding)
        if text.startswith("note: "):
            self.lines.append(text.removeprefix("note: "))
        else:
            self.warnings.append(text)

    def fail(self, finding: str | Fault, where: Location | None = None) -> None:
        """Why the verdict is negative."""
        self.failures.append(_text(finding))

    @contextmanager
    def stages(self) -> Iterator[Observer]:
        """Whoever was named."""
        yield self.observe

    @contextmanager
    def progress(self, step: str, total: int | None) -> Iterator[Callable[[int], None]]:
        """Whoever was named is told how many are done."""
        done = 0

        def tick(count: int) -> None:
            nonlocal done
            done += count
            self.observe(Stage(step, done, total))

        yield tick

    @contextmanager
    def step(self, name: str) -> Iterator[None]:
        """Whoever was named is told of it."""
        self.observe(Stage(name))
        yield


def _text(finding: str | Fault) -> str:
    return (finding if isinstance(finding, str) else finding.text()).strip().removeprefix(_WARNING)
