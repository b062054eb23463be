"""What stands above a picture: machine, file and date."""

from __future__ import annotations

import os
from collections.abc import Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from typing import TYPE_CHECKING, Any

from pkmcal_cli.base.files import is_stream, readable

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_LEAST = 8  # characters
_MARGIN = 0.4  # inches beside a title


@dataclass(frozen=True)
class Titles:
    """Two lines: what is shown of which machine; from which files, of which date. All names as they can be drawn."""

    machine: str
    subject: str
    source: str

    def write(self, figure: Figure) -> None:
        """At the top of a figure whose parts are placed by hand."""
        height = figure.get_size_inches()[1]
        first = f"{self.machine}: {self.subject}" if self.subject else self.machine
        _line(figure, 1 - 0.12 / height, first, size=10, weight="bold")
        _line(figure, 1 - 0.34 / height, self.source, size=8, color="0.3")


def _line(figure: Figure, y: float, text: str, **style: Any) -> None:
    """A line in the middle, shortened until it fits."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg

    renderer = FigureCanvasAgg(figure).get_renderer()  # type: ignore[no-untyped-call]
    room = (figure.get_size_inches()[0] - 2 * _MARGIN) * figure.dpi
    line = figure.text(0.5, y, text, ha="center", va="top", **style)
    while (width := line.get_window_extent(renderer).width) > room and len(text) > _LEAST:
        text = shortened(text, min(len(text) - 1, len(text) * room / width))
        line.set_text(text)


def titles(machine: str, subject: str, files: Sequence[str]) -> Titles:
    """Titles of a picture of a machine file and of measured files, of which the last one's date is told."""
    names = ", ".join(dict.fromkeys(plain(_name(f)) for f in files))
    date = _date(files[-1] if files else None)
    return Titles(plain(_name(machine)), plain(subject), f"{names}, {date}" if names else date)


def _name(file: str) -> str:
    return "<stdin>" if is_stream(file) else os.path.basename(file) or file


def _date(file: str | None) -> str:
    """Day on which a file was last changed, or today where there is none."""
    try:
        dated = file is not None and not is_stream(file)
        when = datetime.fromtimestamp(os.stat(str(file)).st_mtime, UTC) if dated else datetime.now(UTC)
    except (OSError, ValueError, OverflowError):
        when = datetime.now(UTC)
    return when.astimezone().date().isoformat()


def plain(text: str) -> str:
    """A text as pictures can hold it: nothing that XML or a line of text cannot."""
    return "".join(c if c.isprintable() else "\N{REPLACEMENT CHARACTER}" for c in readable(text))


def shortened(text: str, most: float) -> str:
    """A text of so many characters at most, without its middle where it is longer."""
    most = max(int(most), _LEAST)
    half = (most - 1) // 2
    return text if len(text) <= most else f"{text[:half]}\N{HORIZONTAL ELLIPSIS}{text[len(text) - half :]}"
