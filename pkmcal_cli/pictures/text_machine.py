"""A machine drawn in characters, for terminals of 80 columns."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise

import numpy as np

from pkmcal_cli.base.rotation import Array
from pkmcal_cli.pictures.joint_symbols import axes_on_page
from pkmcal_cli.pictures.shapes import MachineShape, Shape
from pkmcal_cli.pictures.views import ISOMETRIC, PLANE, View, hull

_COLUMNS, _ROWS, _FLAT = 78, 30, 5  # of the page; rows of a machine on one line
_TALL = 2.0  # height of a character by its width
_GUIDE, _REFERENCE, _GROUND, _JOINT, _DRIVE, _TOOL, _AXIS = ":", ".", "^", "o", "#", "@", "+"
BELIEVED = f"  {_REFERENCE} where the control believes it to be"
_BESIDE = ((0, 2), (0, -2), (-1, 1), (1, 1), (-1, -1), (1, -1), (-1, 0), (1, 0), (-2, 1), (2, 1), (-2, -1), (2, -1))


def text_legend(shape: MachineShape) -> str:
    """What the characters mean; axes only of a machine that shows some."""
    axes = f"  {_AXIS} axis" if axes_on_page(shape, shape.actual, _view(shape)) else ""
    return f"{_GUIDE} guide  {_GROUND} base  {_JOINT} joint or node{axes}  {_DRIVE} drive  {_TOOL} tool point"


def _view(shape: MachineShape) -> View:
    return PLANE if shape.planar else ISOMETRIC


def text_machine(shape: MachineShape, factor: float) -> list[str]:
    """Lines of the drawing: displacements `factor` times; of a machine in space the isometric view."""
    shown = shape.reference.towards(shape.actual, factor)
    page = _Page(_view(shape), np.vstack([shape.corners(shape.reference), shape.corners(shown)]))
    if shape.moved:
        for course in shape.reference.members.values():
            page.line(course, _REFERENCE)
    for course in shown.guides.values():
        page.line(course, _GUIDE)
    for _, axis in axes_on_page(shape, shown, page.view):
        page.line(axis, _AXIS)
    for body in shape.machine.bodies:
        corners = shape.outline(body, shown)
        ring = list(hull(page.view.of(corners)))
        page.line(corners[[*ring, ring[0]]])
    for course in shown.members.values():
        page.line(course)
    _mark(page, shape, shown)
    return page.text()


def _mark(page: _Page, shape: MachineShape, shown: Shape) -> None:
    """Markers over the lines, then the names of drives and of the tool point."""
    for name in shape.machine.joints:
        page.mark(shape.symbol(name, shown), _JOINT)
    for name, point in shown.places.items():
        page.mark(point, _GROUND if name in shape.machine.ground else _JOINT)
    drives = {name: shape.at_drive(name, shown) for name in shape.readings}
    for point in drives.values():
        page.mark(point, _DRIVE)
    tool = shape.tool
    if tool is not None:
        page.mark(shown.places[tool], _TOOL)
        drives[tool] = shown.places[tool]
    for name, point in drives.items():
        page.write(point, name)


class _Page:
    """Cells of a page that shows places (K, 3) from one side."""

    def __init__(self, view: View, corners: Array) -> None:
        self.view = view
        at = view.of(corners)
        low, high = at.min(axis=0), at.max(axis=0)
        size = np.maximum(high - low, 1e-12)
        room = np.array([_COLUMNS - 1, (_ROWS - 1) * _TALL])
        self.per_column = float((size / room).max())
        rows = max(round(size[1] / (_TALL * self.per_column)) + 1, _FLAT)
        self.middle = 0.5 * (low + high)
        self.cells = np.full((rows, _COLUMNS), " ")
        self.kept = np.zeros(self.cells.shape, dtype=bool)  # markers and names, over which no name is written

    def cell(self, point: Array) -> tuple[int, int]:
        """Row and column of a place (3,)."""
        across, up = (self.view.of(point) - self.middle) / self.per_column
        row = round((len(self.cells) - 1) / 2 - up / _TALL)
        column = round((_COLUMNS - 1) / 2 + across)
        return int(np.clip(row, 0, len(self.cells) - 1)), int(np.clip(column, 0, _COLUMNS - 1))

    def line(self, course: Array, character: str = "") -> None:
        """A line through places (K, 3), in characters that lean as it does unless one is given."""
        for a, b in pairwise(course):
            (r, c), (s, d) = self.cell(a), self.cell(b)
            count = max(abs(s - r), abs(d - c), 1)
            for k in range(count + 1):
                self.cells[round(r + (s - r) * k / count), round(c + (d - c) * k / count)] = character or _leaning(
                    d - c, _TALL * (s - r)
                )

    def mark(self, point: Array, character: str) -> None:
        """A marker."""
        at = self.cell(point)
        self.cells[at], self.kept[at] = character, True

    def write(self, point: Array, name: str) -> None:
        """A name beside a place, where no other name or marker is; below the drawing where there is no room."""
        row, column = self.cell(point)
        name = name[: _COLUMNS - 2]
        best: tuple[int, int, int] | None = None
        for down, across in _BESIDE:
            first = column + across - (0 if across > 0 else len(name) - 1 if across < 0 else len(name) // 2)
            r, c = row + down, int(np.clip(first, 0, _COLUMNS - len(name)))
            if not 0 <= r < len(self.cells) or self.kept[r, max(c - 1, 0) : c + len(name) + 1].any():
                continue
            covered = int((self.cells[r, c : c + len(name)] != " ").sum())
            if best is None or covered < best[0]:
                best = covered, r, c
        if best is None:
            self._append(column, name)
            return
        _, r, c = best
        self.cells[r, c : c + len(name)] = list(name)
        self.kept[r, c : c + len(name)] = True

    def _append(self, column: int, name: str) -> None:
        """A name in the first free row below."""
        c = min(column, _COLUMNS - len(name))
        row = np.full((1, _COLUMNS), " ")
        row[0, c : c + len(name)] = list(name)
        self.cells = np.vstack([self.cells, row])
        self.kept = np.vstack([self.kept, row != " "])

    def text(self) -> list[str]:
        """Lines without spaces at their ends; none that is empty at the top or at the bottom."""
        lines: Sequence[str] = ["".join(row).rstrip() for row in self.cells]
        used = [k for k, line in enumerate(lines) if line]
        return list(lines[used[0] : used[-1] + 1]) if used else []


def _leaning(across: float, down: float) -> str:
    """The character that leans like a line."""
    if abs(down) < 0.4 * abs(across):
        return "-"
    if abs(across) < 0.4 * abs(down):
        return "|"
    return "\\" if across * down > 0 else "/"
