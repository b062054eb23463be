"""A sheet as one HTML file: pictures inside, no script, nothing from the network."""

from __future__ import annotations

import re
from html import escape
from importlib.resources import files
from typing import TYPE_CHECKING

from pkmcal_cli.sheet.content import Sheet

if TYPE_CHECKING:
    from pkmcal_cli.pictures.picture import Picture

_TEMPLATE = "page.html.jinja"
_REFERENCE = re.compile(r'(href="#|url\(#)([^")]+)')
_ID = re.compile(r' id="([^"]+)"')


def html(sheet: Sheet) -> str:
    """The page."""
    from jinja2 import Environment

    drawn = 0

    def svg(picture: Picture) -> str:
        nonlocal drawn
        drawn += 1
        return _inline(picture, f"f{drawn}-")

    environment = Environment(autoescape=True, trim_blocks=True, lstrip_blocks=True, keep_trailing_newline=True)
    text = files(__package__).joinpath(_TEMPLATE).read_text(encoding="utf-8")
    return environment.from_string(text).render(sheet=sheet, svg=svg)


def _inline(picture: Picture, prefix: str) -> str:
    """The picture as part of a page: as wide as its place, its names its own, told to readers that do not see."""
    text = picture.svg()
    used = {m.group(2) for m in _REFERENCE.finditer(text)}  # names of several pictures would meet
    text = _ID.sub(lambda m: f' id="{prefix}{m.group(1)}"' if m.group(1) in used else "", text)
    text = _REFERENCE.sub(lambda m: f"{m.group(1)}{prefix}{m.group(2)}", text)
    head, remainder = text.split(">", 1)
    head = re.sub(r' (width|height)="[^"]*"', "", head)
    label = escape(picture.alt, quote=True)
    return f'{head} role="img" aria-label="{label}" style="max-width: {picture.size[0]:g}in">{remainder}'
