"""A machine drawn from its file: nodes, guides, members, bodies and drives, reference and exaggerated."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise
from typing import TYPE_CHECKING, Any

import numpy as np

from pkmcal_cli.base.rotation import Array
from pkmcal_cli.pictures.joint_symbols import AXIS, SYMBOLS, axes_on_page, draw_axes, draw_travel, symbols
from pkmcal_cli.pictures.labels import Label, put_labels
from pkmcal_cli.pictures.machine_legend import BODY, GUIDE, drive_marks, legend_height, write_legend
from pkmcal_cli.pictures.picture import AFTER, BEFORE, FITTED, NOISE, OTHER, Picture
from pkmcal_cli.pictures.shapes import MachineShape, Shape
from pkmcal_cli.pictures.titles import Titles, shortened
from pkmcal_cli.pictures.views import Pane, View, hull, panes
from pkmcal_cli.report.number_format import handy
from pkmcal_cli.units.unit_text import parse_unit

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

_SHOWN = 0.08  # of the machine's size: the largest displacement as it is drawn, where no scale is given
_TURN_SHOWN = 0.35  # rad
_ROUND = (1.0, 2.0, 5.0)
_LONG = 28  # characters, of a name
_THIN, _THICK = 1.2, 4.5  # points, of members by their force
_SLIGHT = 1e-6  # of the largest force: no force


def default_scale(shape: MachineShape) -> float:
    """A round factor by which the largest displacement (where there is none, turn of an axis) is seen well; at least 1.

    1 where nothing is displaced.
    """
    size, angle = shape.largest[1], shape.most_turned[1]
    most = _SHOWN * shape.length / size if size else _TURN_SHOWN / angle if angle else 1.0
    if most <= 1.0:
        return 1.0
    power = 10.0 ** np.floor(np.log10(most))
    return float(power * max(r for r in _ROUND if r * power <= most * (1 + 1e-9)))


def displacement_text(shape: MachineShape) -> str:
    """What is displaced most and how far; where no point is, which joint's axis is turned most; else nothing."""
    (point, size), (joint, angle) = shape.largest, shape.most_turned
    if size:
        return f"largest displacement: {handy(size, parse_unit('mm'))}, of {point}"
    return f"largest turn: {handy(angle, parse_unit('deg'))}, of the axis of {joint}" if angle else ""


def machine_picture(
    shape: MachineShape, titles: Titles, *, scale: float | None = None, forces: bool = False, name: str = "machine"
) -> Picture:
    """The machine where the control believes it to be (grey) and where it is (black), displacements `scale` times.

    forces: members in the colour and width of their axial force, and numbers at members and drives.
    """
    factor = default_scale(shape) if scale is None else scale
    shown = shape.reference.towards(shape.actual, factor)
    corners = np.vstack([shape.corners(shape.reference), shape.corners(shown)])
    size, views = panes(corners, shape.planar, legend_height(shape, forces))
    moved = displacement_text(shape) or "nothing is displaced"
    alt = f"{titles.machine}: {len(shape.actual.members)} members, drives {', '.join(shape.readings)}; {moved}."

    def draw(figure: Figure) -> None:
        figure.set_layout_engine("none")
        titles.write(figure)
        for pane in views:
            _Drawing(shape, shown, factor, forces, pane).draw(figure, size)
        write_legend(figure, size, shape, factor, forces=forces)

    return Picture(name, f"{titles.machine}: drawing", alt, size, draw)


@dataclass(frozen=True)
class _Drawing:
    """One view of a machine; `shown`: its actual shape, exaggerated by `factor`."""

    shape: MachineShape
    shown: Shape
    factor: float
    forces: bool
    pane: Pane

    @property
    def view(self) -> View:
        return self.pane.view

    def draw(self, figure: Figure, size: tuple[float, float]) -> None:
        """All of the view, then its labels."""
        left, bottom, width, height = self.pane.box
        ax = figure.add_axes((left / size[0], bottom / size[1], width / size[0], height / size[1]))
        unit = self.shape.machine.file_units.length
        limits = self.pane.limits / unit.scale
        ax.set_xlim(*limits[:, 0])
        ax.set_ylim(*limits[:, 1])
        if self.view.names is None or not self.shape.extent:
            ax.set_xticks([])
            ax.set_yticks([])
        if self.view.names is not None:
            ax.tick_params(labelsize=8)
            scale = f" [{unit.text}]" if self.shape.extent else ""  # axes are as long as they are legible
            ax.set_xlabel(f"{self.view.names[0]}{scale}", labelpad=2)
            ax.set_ylabel(f"{self.view.names[1]}{scale}", labelpad=2)
        if self.view.title:
            ax.set_title(self.view.title, fontsize=9, pad=3)
        if self.shape.moved:
            self._skeleton(ax, self.shape.reference, reference=True)
        self._skeleton(ax, self.shown, reference=False)
        self._marks(ax)
        symbols_at = [self.shape.symbol(name, self.shown) for name in self.shown.joints]
        taken = self._on_page(np.array([*self.shown.places.values(), *symbols_at]))
        if self.view.names is None:
            taken = np.vstack([taken, self._triad(ax, taken)])
        put_labels(ax, self._labels(), taken, self._lines())

    def _on_page(self, places: Array) -> Array:
        return np.asarray(self.view.of(places) / self.shape.machine.file_units.length.scale)

    def _lines(self) -> list[Array]:
        courses = [*self.shown.members.values(), *self.shown.guides.values()]
        axes = [axis for _, axis in axes_on_page(self.shape, self.shown, self.view)]
        return [self._on_page(course) for course in [*courses, *axes]]

    def _triad(self, ax: Axes, taken: Array) -> Array:
        """The base's axes in that corner of a view without axes where least is; places (K, 2) where no label stands."""
        low, high = self.pane.limits / self.shape.machine.file_units.length.scale
        size = 0.08 * float((high - low).max())
        corners = [np.array([x, y]) for y in (low[1] + 1.6 * size, high[1] - 1.6 * size)
                   for x in (low[0] + 1.6 * size, high[0] - 1.6 * size)]  # fmt: skip
        dense = np.vstack([taken, *(_along(line) for line in self._lines())])
        start = max(corners, key=lambda c: float(np.hypot(*(dense - c).T).min()))
        ends = [start + size * self.view.of(axis) for axis in np.eye(3)]
        for letter, end in zip("xyz", ends, strict=True):
            ax.annotate("", _pair(end), _pair(start), arrowprops={"arrowstyle": "->", "color": "0.35", "lw": 0.9})
            x, y = _pair(start + 1.35 * (end - start))
            ax.text(x, y, letter, ha="center", va="center", size=8, color="0.35")
        return np.array([start, *ends, *(start + 1.35 * (end - start) for end in ends)])

    def _skeleton(self, ax: Axes, shape: Shape, reference: bool) -> None:
        """Guides, bodies and members of one shape."""
        style: dict[str, Any] = {"color": NOISE, "lw": 0.9, "ls": (0, (4, 2))} if reference else {"color": FITTED}
        for course in shape.guides.values():
            ax.plot(*self._on_page(course).T, zorder=1, gid="guide", **(style if reference else GUIDE))
        for body in self.shape.machine.bodies:
            outline = self._outline(shape, body)
            if reference:
                ax.plot(*outline.T, zorder=2, **style)
            else:
                ax.fill(*outline.T, facecolor=BODY, edgecolor=FITTED, lw=0.9, zorder=3, gid="body")
        for joint in self.shape.machine.joints.values():  # telescopes: the ends that slide are apart
            if all(name in shape.places for name in joint.between):
                ends = self._on_page(np.array([shape.places[name] for name in joint.between]))
                ax.plot(*ends.T, zorder=2, gid="joint", **(style if reference else {"color": FITTED, "lw": 0.9}))
        for name, course in shape.members.items():
            line = style if reference else self._strength(name)
            ax.plot(*self._on_page(course).T, zorder=2 if reference else 4, gid=f"member-{name}", **line)

    def _outline(self, shape: Shape, body: str) -> Array:
        """Corners (K, 2) of the hull of the points of a body, closed."""
        at = self._on_page(self.shape.outline(body, shape))
        ring = list(hull(at))
        return np.asarray(at[[*ring, ring[0]] if len(ring) > 2 else ring])

    def _strength(self, name: str) -> dict[str, Any]:
        """How a member is drawn: by its force, where forces are shown."""
        if not self.forces:
            return {"color": FITTED, "lw": 1.6, "solid_capstyle": "round"}
        force = self.shape.tensions.get(name, 0.0)
        most = max((abs(f) for f in self.shape.tensions.values()), default=0.0)
        if abs(force) <= _SLIGHT * most or not most:
            return {"color": NOISE, "lw": _THIN}
        ends = {"solid_capstyle": "round", "ls": "-"} if force > 0 else {"dash_capstyle": "butt", "ls": (0, (3, 0.8))}
        width = _THIN + (_THICK - _THIN) * float(np.sqrt(abs(force) / most))
        return {"color": AFTER if force > 0 else BEFORE, "lw": width, **ends}

    def _marks(self, ax: Axes) -> None:
        """Directions of guides, axes of joints, markers of points, joints, drives and of the tool point."""
        reach = self.shape.half_axis / self.shape.machine.file_units.length.scale
        for name, course in self.shown.guides.items():
            draw_travel(ax, name, self._on_page(course), reach)
        for name, line in axes_on_page(self.shape, self.shown, self.view):
            draw_axes(ax, name, self._on_page(line))
        for kind, places in symbols(self.shape, self.shown).items():
            if places:
                ax.plot(*self._on_page(np.array(places)).T, ls="none", mew=0.8, zorder=5, gid=kind, **SYMBOLS[kind])
        marks = drive_marks(self.shape)
        for name in self.shape.readings:
            at, marker = self._on_page(self.shape.at_drive(name, self.shown)), marks[name in self.shape.turning][0]
            ax.plot(*at, marker=marker, ms=7, mfc=OTHER, mec="white", mew=0.8, ls="none", zorder=6, gid=f"drive-{name}")
        if self.shape.tool is not None:
            self._tool(ax, self.shape.tool)

    def _tool(self, ax: Axes, name: str) -> None:
        """The tool point, and the arrow of its displacement as it is drawn."""
        start, end = (self._on_page(s.places[name]) for s in (self.shape.reference, self.shown))
        if self.shape.largest[1]:
            ax.plot(*start, marker="+", ms=9, mew=1, color=NOISE, ls="none", zorder=6)
            style = {"arrowstyle": "-|>", "color": BEFORE, "lw": 1.2, "shrinkB": 0}
            ax.annotate("", _pair(end), _pair(start), arrowprops=style)
        ax.plot(*end, marker="D", ms=5, mfc=BEFORE, mec="white", mew=0.6, ls="none", zorder=7, gid="tool")

    def _labels(self) -> list[Label]:
        """Drives first, then the tool point, forces of members, and names of points and members where there is room.

        In the small views of a machine in space only names of drives.
        """
        drives = {n: self._on_page(self.shape.at_drive(n, self.shown)) for n in self.shape.readings}
        green = "#00664b"
        if self.view.names is not None and not self.shape.planar:
            return [_label(n, at, green, bold=True, needed=False) for n, at in drives.items()]
        out = [_label(n, at, green, self._drive_force(n), size=9, bold=True) for n, at in drives.items()]
        tool, places = self.shape.tool, self.shown.places
        if tool is not None:
            out.append(_label(tool, self._on_page(places[tool]), "#a34700", bold=True))
        middle = {n: self._on_page(_middle(course)) for n, course in self.shown.members.items()}
        tensions = self.shape.tensions if self.forces else {}
        pulled = {n: at for n, at in middle.items() if n in tensions}
        out += [_label(n, at, "black", f" {newtons(tensions[n])}", size=7.5) for n, at in pulled.items()]
        out += [_label(n, at, "0.2", size=7.5, needed=False) for n, at in middle.items() if n not in pulled]
        turning = dict(axes_on_page(self.shape, self.shown, self.view))
        hinges = {n: self.shape.symbol(n, self.shown) for n in turning if n in self.shape.machine.joints}
        out += [_label(n, self._on_page(at), AXIS, size=7.2, needed=False) for n, at in hinges.items()]
        points = {", ".join(names): places[names[0]] for names in self.shape.together if names[0] != tool}
        out += [_label(n, self._on_page(at), "0.35", size=7.2, needed=False) for n, at in points.items()]
        return out

    def _drive_force(self, name: str) -> str:
        return f" {newtons(self.shape.forces[name], name in self.shape.turning)}" if self.forces else ""


def _label(
    name: str, at: Array, colour: str, number: str = "", *, size: float = 8.0, bold: bool = False, needed: bool = True
) -> Label:
    """A name, shortened where it is long, and a number behind it."""
    text = shortened(name, _LONG) + number
    return Label(text=text, at=at, colour=colour, size=size, bold=bold, needed=needed)


def newtons(force: float, turning: bool = False) -> str:
    """A force or moment (SI) with its unit."""
    if not np.isfinite(force):
        return "-"
    text = handy(force, parse_unit("N m" if turning else "N"))
    return "0 N m" if text.startswith("-0 ") and turning else "0 N" if text.startswith("-0 ") else text


def _middle(course: Array) -> Array:
    return np.asarray(0.5 * (course[(len(course) - 1) // 2] + course[len(course) // 2]))


def _pair(xy: Array) -> tuple[float, float]:
    return float(xy[0]), float(xy[1])


def _along(line: Array) -> Array:
    """Places along a line (K, 2)."""
    return np.vstack([a + (b - a) * np.linspace(0, 1, 20)[:, None] for a, b in pairwise(line)])
