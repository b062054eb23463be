"""The terminal: tables and messages on stderr, JSON on stdout."""

from __future__ import annotations

import json
import sys
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from typing import TYPE_CHECKING, Any

from pkmcal_cli.base.annotations import FORMATS, Severity, annotation, of_fault
from pkmcal_cli.base.errors import Fault, Location, UsageError, did_you_mean
from pkmcal_cli.base.outputs import write_text
from pkmcal_cli.base.stages import Observer, Stage, unobserved
from pkmcal_cli.base.styles import styled, wants_styles
from pkmcal_cli.base.visible import json_safe, visible
from pkmcal_cli.report.outputs.schema import all_outputs
from pkmcal_cli.report.table_layout import columns_of, laid_out

if TYPE_CHECKING:
    from rich.console import Console, RenderableType

_BAR = 24
_WIDTH = 160  # of tables that do not go to a terminal


class Reporter:
    """Writes for people to stderr; when quiet, only errors. `style` "github": annotations too."""

    def __init__(self, quiet: bool = False, style: str = "text") -> None:
        from rich.console import Console

        if style not in FORMATS:
            raise UsageError(f"--format: `{style}` is not a format", hint=did_you_mean(style, FORMATS))
        wide = None if sys.stderr.isatty() else _WIDTH
        self.quiet, self.annotated = quiet, style == "github"
        self.console: Console = Console(stderr=True, soft_wrap=True, highlight=False, width=wide)
        setattr(self.console, "on_broken_pipe", _nothing)  # noqa: B010  (rich would end the process)

    def say(self, text: str = "") -> None:
        """A line."""
        self._line(text)

    def notes(self, notes: Iterable[str]) -> None:
        """Announcements."""
        for note in notes:
            self._line(f"note: {note}", "dim")

    def warn(self, finding: str | Fault, where: Location | None = None) -> None:
        """A warning; `where`: the place that a text is about."""
        self._finding(finding, "yellow")
        self.mark(finding, where, "warning")

    def fail(self, finding: str | Fault, where: Location | None = None) -> None:
        """Why the verdict is negative, `where` as for a warning: shown even when quiet."""
        self._finding(finding, "red", always=True)
        self.mark(finding, where, "error")

    def refuse(self, verdict: str, where: Location | None = None) -> None:
        """A negative verdict that the report begins with: alone where that is not shown, and as an annotation."""
        if self.quiet:
            self._finding(verdict, "red", always=True)
        self.mark(verdict, where, "error")

    def mark(self, finding: str | Fault, where: Location | None, severity: Severity) -> None:
        """A finding as an annotation alone, where these are asked for; when quiet, only errors."""
        if not (self.annotated and finding) or (self.quiet and severity == "warning"):
            return
        text = finding.strip().removeprefix("warning: ") if isinstance(finding, str) else ""
        line = of_fault(finding) if isinstance(finding, Fault) else annotation(severity, text, where)
        with suppress(OSError, ValueError):
            print(visible(line), file=sys.stderr, flush=True)

    def _line(self, text: str, style: str | None = None, always: bool = False) -> None:
        if always or not self.quiet:
            from rich.text import Text

            self._print(Text(visible(text), style=style or ""))

    def _finding(self, finding: str | Fault, colour: str, always: bool = False) -> None:
        """A sentence in a colour; a fault with its parts apart."""
        if isinstance(finding, str):
            self._line(finding, colour, always)
        elif always or not self.quiet:
            from rich.text import Text

            text = finding.text()
            self._print(Text.from_ansi(styled(text)) if wants_styles(sys.stderr) else Text(text))

    def _print(self, shown: RenderableType) -> None:
        with suppress(OSError):  # a closed stderr does not end the work
            self.console.print(shown)

    def table(
        self,
        title: str,
        headers: Sequence[str],
        rows: Iterable[Sequence[str]],
        left: int = 1,
        folded: Sequence[str] = ("remark",),
        spare: Sequence[str] = (),
    ) -> None:
        """A table; the first `left` columns are names, those `folded` are texts, which go on in further lines where
        it is wide; a narrow terminal does without those that are `spare`, the first ones first, and it is said.
        """
        if self.quiet:
            return
        from rich.text import Text

        width = self.console.width
        laid = laid_out(columns_of(headers, rows, left, folded), width, left, spare)
        self._line(title, "italic")
        for k, line in enumerate(laid.lines):
            self._print(Text(visible(line), style="bold" if k in laid.heads else ""))
        if laid.hidden:
            columns = ", ".join(header or "bars" for header in laid.hidden)
            self._line(f"not shown in {width} columns: {columns} (widen the terminal, or use --json)", "dim")

    @contextmanager
    def progress(self, step: str, total: int | None) -> Iterator[Callable[[int], None]]:
        """Who is told how many more of these are done, of how many; None where nobody knows."""
        with self.stages() as observe:
            done = 0
            observe(Stage(step, done, total))

            def tick(count: int) -> None:
                nonlocal done
                done += count
                observe(Stage(step, done, total))

            yield tick

    @contextmanager
    def step(self, name: str) -> Iterator[None]:
        """A work of which nobody knows how long it is; it is named while it lasts."""
        with self.stages() as observe:
            observe(Stage(name))
            yield

    @contextmanager
    def stages(self) -> Iterator[Observer]:
        """Who is told where a long work has come to: a bar on a terminal, nobody elsewhere."""
        from pkmcal_cli.report.progress_bar import progress_bar, shown_on

        if not shown_on(self.console, self.quiet):
            yield unobserved
            return
        with progress_bar(self.console) as observe:
            yield observe


def _nothing() -> None:
    """A reader of stderr that has gone is no reason to stop."""


def bar(share: float, width: int = _BAR) -> str:
    """A horizontal bar of a share between 0 and 1."""
    eighths = round(max(0.0, min(1.0, share)) * width * 8)
    full, eighths_left = divmod(eighths, 8)
    return "\u2588" * full + (" \u258f\u258e\u258d\u258c\u258b\u258a\u2589"[eighths_left] if eighths_left else "")


def enveloped(command: str, verdict: str, result: Mapping[str, Any], head: Mapping[str, Any]) -> dict[str, Any]:
    """A result as `--json` writes it: which output it is, the verdict, the result, where it comes from."""
    output = all_outputs()[command]
    return {"schema": output.schema, "verdict": verdict} | {**result, "verdict": verdict, "provenance": dict(head)}


def emit_json(result: Mapping[str, Any]) -> None:
    """The result on stdout. Raises OutputError."""
    text = json_safe(json.dumps(result, indent=2, allow_nan=False, ensure_ascii=False))
    with write_text("-", ()) as file:
        file.write(text + "\n")
