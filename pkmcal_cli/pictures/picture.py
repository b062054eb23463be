"""What a picture is, and how it becomes a file (SVG, PNG, PDF) or a part of a page."""

from __future__ import annotations

import io
import os
import warnings
from collections.abc import Callable, Collection, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from pkmcal_cli.base.errors import UsageError
from pkmcal_cli.base.files import is_stream
from pkmcal_cli.base.outputs import check_target, write_text

if TYPE_CHECKING:
    from matplotlib.figure import Figure

FORMATS = ("svg", "png", "pdf")
BEFORE, AFTER, FITTED, NOISE, OTHER = "#D55E00", "#0072B2", "#000000", "#8c8c8c", "#009E73"
"""Colours that the colour-blind tell apart (Okabe and Ito 2008); a marker or line style goes with each."""
LOOKS = ((AFTER, "o"), (BEFORE, "s"), (OTHER, "^"), ("#CC79A7", "v"), ("#56B4E9", "D"), (FITTED, "P"))
"""Colours and markers of the series of a panel; all markers are filled."""
_DPI = 150
_STYLE: Any = {
    "svg.fonttype": "none",  # text stays text: searchable, and small
    "svg.hashsalt": "pkmcal",
    "font.size": 9,
    "text.parse_math": False,  # names are names, also with `$` and `_`
    "axes.grid": True,
    "grid.alpha": 0.3,
    "axes.formatter.useoffset": False,
    "axes.formatter.limits": (-5, 6),
}


@dataclass(frozen=True)
class Picture:
    """A picture: name of its file without ending, title, what it shows in words, size in inches, and who draws it."""

    name: str
    title: str
    alt: str
    size: tuple[float, float]
    draw: Callable[[Figure], None]

    def figure(self) -> Figure:
        """The picture as a matplotlib figure, for a notebook."""
        with drawn(self) as figure:
            return figure

    def svg(self) -> str:
        """The picture as an `svg` element, without the head of a file."""
        text = io.StringIO()
        with drawn(self) as figure:
            figure.savefig(text, format="svg", metadata={"Date": None})
        whole = text.getvalue()
        return whole[whole.index("<svg") :]


@contextmanager
def drawn(picture: Picture) -> Iterator[Figure]:
    """A figure with the picture drawn on it, in our style. What names have no glyph for is a box, not a warning."""
    from matplotlib import rc_context
    from matplotlib.figure import Figure

    with rc_context(_STYLE), warnings.catch_warnings():
        warnings.filterwarnings("ignore", message="Glyph .* missing from font")
        figure = Figure(figsize=picture.size, layout="constrained")
        picture.draw(figure)
        yield figure


def format_of(file: str, option: str = "--plot") -> str:
    """Format of a picture's file, by its ending. Raises UsageError for another, and for a stream."""
    ending = os.path.splitext(file)[1].lower().lstrip(".")
    if is_stream(file) or ending not in FORMATS:
        raise UsageError(f"{option}: `{file}` is no picture", hint="name a file that ends with .svg, .png or .pdf")
    return ending


def check_picture(file: str | None, inputs: Collection[str], *, force: bool, option: str = "--plot") -> None:
    """Find out before the work whether a picture could be written. Raises UsageError and OutputError."""
    if file is not None:
        format_of(file, option)
        check_target(file, inputs, force=force)


def write_picture(picture: Picture, file: str, inputs: Collection[str], *, force: bool) -> None:
    """Write a picture. Raises UsageError and OutputError."""
    kind = format_of(file)
    with drawn(picture) as figure:
        dates: dict[str, dict[str, Any]] = {"svg": {"Date": None}, "pdf": {"CreationDate": None}}
        with write_text(file, inputs, force=force) as text:
            metadata = {"Title": picture.title} | dates.get(kind, {})
            figure.savefig(text.buffer, format=kind, dpi=_DPI, metadata=metadata)
