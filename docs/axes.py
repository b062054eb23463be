"""Draws docs/axes.svg: the axes of guides and carriages, as the program has them.

`python -m docs.axes` (from the repository's folder); a test fails while the picture is stale. Each panel shows what its
machine file says: the places of carriages, their points and the ends of their axes are predicted by the program.
"""

from __future__ import annotations

import tempfile
from dataclasses import dataclass, field
from html import escape
from pathlib import Path

import numpy as np

from pkmcal_cli.base.rotation import Array, exp
from pkmcal_cli.loading.load_machine import load_machine
from pkmcal_cli.prediction import Rows, predict

FILE = Path(__file__).with_name("axes.svg")
WIDTH, HEIGHT = 900, 436
ARM = 42.0  # mm, length of the axes drawn
COLOURS = ("#c62828", "#2e7d32", "#1565c0")
_BESIDE = ((4, -4), (-18, -4), (-6, 14))  # rx, ry, rz: label of a turn in space
GREY, DARK, LIGHT = "#8a8a8a", "#212121", "#e3e7ee"
FLAT = np.array([[1.0, 0, 0], [0, 1, 0]])
OBLIQUE = 1.25 * np.array([[-0.87, 0.5, 0.0], [-0.2, -0.35, 0.92]])


@dataclass(frozen=True, kw_only=True)
class Panel:
    """A machine of one guide and one carriage, and how it is looked at.

    `frame`: origin (mm) and turn (deg; rotation vector), `at` and `along` of the guide, `travel` of the carriage and a
    `point` of it; `view` (2, 3): right and up on the page in base axes; `corner`: where the base is on the page.
    """

    title: str
    frame: tuple[tuple[float, ...], tuple[float, ...]]
    at: tuple[float, ...]
    along: str
    travel: float
    point: tuple[float, ...]
    view: Array
    corner: tuple[float, float]
    turns: tuple[int, ...]  # axes about which turns are shown

    @property
    def planar(self) -> bool:
        """Whether it is a machine in the plane."""
        return len(self.at) == 2

    def lines(self) -> list[str]:
        """The sections of its machine file."""
        origin, turn = (list(part) for part in self.frame)
        return [
            "frames:",
            f"  f: {{at: {origin}, turn: {turn[0] if self.planar else turn}}}",
            "guides:",
            f"  g: {{frame: f, at: {list(self.at)}, along: {self.along}}}",
            "bodies:",
            f"  c: {{guide: g, at: {self.travel:g}, points: {{P: {list(self.point)}}}}}",
        ]

    def machine(self) -> str:
        """The machine file, with the ends of the carriage's axes as further points and all places measured."""
        axes = "xy" if self.planar else "xyz"
        ends = {letter.upper(): [ARM * (k == i) for k in range(len(axes))] for i, letter in enumerate(axes)}
        points = ", ".join(f"{name}: {end}" for name, end in ends.items())
        return "\n".join((
            "units: {length: mm, angle: deg}", f"space: {'planar' if self.planar else 'spatial'}",
            *(line.replace("P: ", f"{points}, P: ") for line in self.lines()), "actuators: {q: {moves: c}}",
            f"sensors: {{s: {{kind: tcp, at: [c, {', '.join(ends)}, P], reads: [{', '.join(axes)}], sigma: 1 um, "
            "frame: machine}}",
        ))  # fmt: skip

    def places(self, travel: float) -> Array:
        """Places of the carriage's origin, of the ends of its axes and of its point, (4 or 5, 3), mm, base axes."""
        with tempfile.TemporaryDirectory() as folder:
            file = Path(folder) / "machine.yaml"
            file.write_text(self.machine(), encoding="utf-8")
            model = load_machine(str(file)).model
        found = predict(model, model.nominal, Rows.at(np.array([[travel * 1e-3]]))).values[0] * 1e3
        flat = found.reshape(-1, len(self.at))
        return np.hstack([flat, np.zeros((len(flat), 3 - flat.shape[1]))])


PANELS = (
    Panel(title="guide along an axis of its frame", frame=((50, 25), (20,)), at=(15, 45), along="x", travel=110,
          point=(0, 45), view=FLAT, corner=(30, 285), turns=(2,)),
    Panel(title="guide askew in its frame", frame=((50, 25), (20,)), at=(15, 45), along="[2, 1]", travel=110,
          point=(0, 45), view=FLAT, corner=(320, 285), turns=(2,)),
    Panel(title="upright guide", frame=((0, 140, 0), (0, 0, 30)), at=(0, 25, 30), along="z", travel=80,
          point=(75, 0, 0), view=OBLIQUE, corner=(632, 190), turns=(0, 1, 2)),
)  # fmt: skip


@dataclass
class Page:
    """Elements of an SVG, drawn in the axes of one panel (mm)."""

    parts: list[str] = field(default_factory=list)
    view: Array = field(default_factory=lambda: FLAT)
    corner: tuple[float, float] = (0.0, 0.0)

    def on_page(self, place: Array) -> tuple[float, float]:
        """Where a place (3,) is on the page."""
        right, up = self.view @ place
        return round(self.corner[0] + right, 1) + 0.0, round(self.corner[1] - up, 1) + 0.0

    def path(self, places: Array, colour: str, width: float = 1.5, more: str = "") -> None:
        """A line through places (N, 3)."""
        points = " ".join(f"{x:g},{y:g}" for x, y in map(self.on_page, places))
        self.parts.append(
            f'<polyline points="{points}" fill="none" stroke="{colour}" stroke-width="{width:g}" {more}/>'
        )

    def arrow(self, start: Array, end: Array, colour: str, width: float = 1.8, more: str = "") -> None:
        """A line with a head at its end."""
        self.path(np.array([start, end]), colour, width, more)
        self.head(start, end, colour)

    def head(self, start: Array, end: Array, colour: str, size: float = 7.0) -> None:
        """The head of an arrow."""
        a, b = np.array(self.on_page(start)), np.array(self.on_page(end))
        way = b - a
        length = float(np.hypot(*way))
        if length < 2:
            return
        way, across = way / length, np.array([-way[1], way[0]]) / length
        corners = (b + 2 * way, b - size * way + 0.4 * size * across, b - size * way - 0.4 * size * across)
        points = " ".join(f"{x:.1f},{y:.1f}" for x, y in corners)
        self.parts.append(f'<polygon points="{points}" fill="{colour}"/>')

    def dot(self, place: Array, colour: str) -> None:
        """A point."""
        x, y = self.on_page(place)
        self.parts.append(f'<circle cx="{x:g}" cy="{y:g}" r="3.2" fill="{colour}"/>')

    def label(self, place: Array, text: str, colour: str = DARK, shift: tuple[float, float] = (5, -5)) -> None:
        """A text beside a place, `shift` to the right and down."""
        x, y = self.on_page(place)
        self.text(x + shift[0], y + shift[1], text, colour)

    def text(self, x: float, y: float, text: str, colour: str = DARK, style: str = "") -> None:
        """A text on the page; what is in backticks is set as in a file."""
        spans = escape(text).split("`")
        marked = "".join(f'<tspan class="m">{s}</tspan>' if k % 2 else s for k, s in enumerate(spans))
        self.parts.append(f'<text x="{x:g}" y="{y:g}" fill="{colour}" {style}>{marked}</text>')


def draw(page: Page, panel: Panel) -> None:
    """One panel: base, frame, guide, and the carriage with its axes, its point and the sense of its turns."""
    page.view, page.corner = panel.view, panel.corner
    letters = "xy" if panel.planar else "xyz"
    origin = np.array([*panel.frame[0], 0.0][:3])
    turn = exp(np.radians([0.0, 0.0, panel.frame[1][0]] if panel.planar else panel.frame[1]))
    start, now = panel.places(0.0), panel.places(panel.travel)
    for at, triad, more in ((np.zeros(3), np.eye(3), ""), (origin, turn, 'stroke-dasharray="4 3"')):
        for k, letter in enumerate(letters):
            colour = GREY if at is not origin else COLOURS[k]
            end = at + 0.8 * ARM * triad[:, k]
            page.arrow(at, end, colour, 1.3, more)
            page.label(end, letter, colour, (4, -3))
    page.label(np.zeros(3), "base", GREY, (-10, 17))
    page.label(origin, "frame `f`", DARK, (2, 17))
    way = (now[0] - start[0]) / panel.travel
    page.path(np.array([start[0] - 25 * way, now[0] + 75 * way]), "#b9c1cf", 6, 'stroke-linecap="round"')
    page.label(now[0] + 75 * way, "guide `g`", DARK, (-48, -10) if panel.planar else (10, 4))
    carriage(page, panel, start, now)


def carriage(page: Page, panel: Panel, start: Array, now: Array) -> None:
    """The carriage, its travel, axes, point and turns; places as `Panel.places` gives them at travel 0 and now."""
    place, axes, point = now[0], (now[1:-1] - now[0]) / ARM, now[-1]
    x, y = 17 * axes[0], 11 * axes[1]
    outline = [place + x + y, place - x + y, place - x - y, place + x - y]
    corners = " ".join(f"{a:g},{b:g}" for a, b in map(page.on_page, outline))
    page.parts.append(f'<polygon points="{corners}" fill="{LIGHT}" stroke="{DARK}" stroke-width="1.2"/>')
    page.dot(start[0], DARK)
    page.label(start[0], "travel 0: `at` of `g`", DARK, (-72, -20) if panel.planar else (10, 14))
    way = place - start[0]
    aside = -22 * axes[1] if panel.planar else np.linalg.pinv(panel.view) @ np.array([56.0, 0.0])
    page.arrow(start[0] + aside, place + aside, DARK, 1)
    page.label(start[0] + aside + 0.5 * way, "travel: `at` of `c`", DARK, (6, 10))
    page.path(np.array([place, point]), DARK, 1, 'stroke-dasharray="2 2"')
    page.dot(point, DARK)
    page.label(point, f"P: {list(panel.point)}", DARK, (-20, -8) if panel.planar else (-52, 17))
    for k, axis in enumerate(axes):
        page.arrow(place, place + ARM * axis, COLOURS[k], 2.4)
        page.label(place + ARM * axis, "xyz"[k], COLOURS[k], (5, 4) if k < 2 else (7, 2))
    full = axes if len(axes) == 3 else np.vstack([axes, np.cross(axes[0], axes[1])])
    for about in panel.turns:
        first, second = full[(about + 1) % 3], full[(about + 2) % 3]
        angles = np.radians(np.linspace(15, 75, 9))[:, None]
        arc = place + 0.62 * ARM * (np.cos(angles) * first + np.sin(angles) * second)
        page.path(arc, COLOURS[about], 1.4)
        page.head(arc[-2], arc[-1], COLOURS[about], 6)
        page.label(arc[4], f"r{'xyz'[about]}", COLOURS[about], _BESIDE[about] if not panel.planar else (4, -3))


def drawn() -> str:
    """The picture."""
    page = Page()
    for panel in PANELS:
        draw(page, panel)
    for k, panel in enumerate(PANELS):
        left = (12, 302, 600)[k]
        page.text(left, 22, panel.title, DARK, 'class="b"')
        for row, line in enumerate(panel.lines()):
            page.text(left + 8 * line.startswith(" "), 322 + 14 * row, f"`{line.strip()}`", DARK)
    first = "A carriage has the axes of its guide's frame, whatever `along` is."
    page.text(12, 424, f"{first} Tilts are positive from x to y (rz), from y to z (rx), from z to x (ry).")
    style = "text{font:12px sans-serif}text.b{font-weight:bold}.m{font:10.5px monospace}"
    head = f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {WIDTH} {HEIGHT}" width="{WIDTH}" height="{HEIGHT}">'
    white = '<rect width="100%" height="100%" fill="white"/>'
    return "\n".join([head, f"<style>{style}</style>", white, *page.parts, "</svg>", ""])


if __name__ == "__main__":
    FILE.write_text(drawn(), encoding="utf-8")
