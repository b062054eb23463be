"""What reports show on a terminal, kept as blocks of a sheet: said once, shown twice."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

from pkmcal_cli.base.errors import Fault, Location
from pkmcal_cli.report.console import Reporter
from pkmcal_cli.sheet.content import Block, Table, Text


class Recorder(Reporter):
    """A reporter that keeps blocks instead of writing them."""

    def __init__(self) -> None:
        super().__init__()
        self.blocks: list[Block] = []

    def say(self, text: str = "") -> None:
        """A paragraph for every line."""
        self.blocks += [Text(line) for line in text.splitlines() if line.strip()]

    def notes(self, notes: Iterable[str]) -> None:
        """Small print."""
        self.blocks += [Text(note, "note") for note in notes]

    def warn(self, finding: str | Fault, where: Location | None = None) -> None:
        """A warning."""
        text = finding if isinstance(finding, str) else finding.text()
        self.blocks.append(Text(text.removeprefix("warning: "), "warning"))

    def fail(self, finding: str | Fault, where: Location | None = None) -> None:
        """Why a verdict is negative."""
        self.warn(finding)

    def table(
        self,
        title: str,
        headers: Sequence[str],
        rows: Iterable[Sequence[str]],
        left: int = 1,
        folded: Sequence[str] = ("remark",),
        spare: Sequence[str] = (),
    ) -> None:
        """A table, without columns that are empty throughout."""
        cells = [tuple(row) for row in rows]
        kept = [k for k, h in enumerate(headers) if h or any(row[k] for row in cells)]
        kept = [k for k in kept if k < left or any(row[k] for row in cells)]
        heads = tuple(headers[k] for k in kept)
        words = tuple(h for h in heads if h in folded or not h)
        self.blocks.append(Table(title, heads, tuple(tuple(r[k] for k in kept) for r in cells), left, words))
