"""Machine files to begin with: texts of `templates/`, whose numbers grow with the machine.

A template is a machine with a span of 1 m. In it `<500>` is a number that grows with the span, `<5^3>` one that grows
with its third power; the unit is that of the machine file, or follows.
"""

from __future__ import annotations

import re
from dataclasses import dataclass
from pathlib import Path

FOLDER = Path(__file__).resolve().parents[1] / "templates"
SPANS = (0.01, 30.0)
"""Smallest and largest span, m."""

_SCALED = re.compile(r"<(-?\d+(?:\.\d+)?)(?:\^(\d))?>")


@dataclass(frozen=True)
class Template:
    """A machine file to begin with; `description`: what machine it is, in a sentence; `span`: what its span is."""

    name: str
    description: str
    span: str
    text: str

    def scaled(self, span: float) -> str:
        """The machine file for a span in m."""
        return _SCALED.sub(lambda match: _number(float(match[1]) * span ** int(match[2] or 1)), self.text)


def names() -> list[str]:
    """The names of all templates."""
    return sorted(file.stem for file in FOLDER.glob("*.yaml"))


def template(name: str) -> Template:
    """The template of a name."""
    text = (FOLDER / f"{name}.yaml").read_text(encoding="utf-8")
    head = [line.removeprefix("# ") for line in text.splitlines()[1:4]]
    return Template(name, head[0], head[2].partition(". ")[0].removeprefix("Span: "), text)


def _number(value: float) -> str:
    """Six digits, without an exponent."""
    return f"{float(f'{value:.6g}'):.12f}".rstrip("0").rstrip(".")
