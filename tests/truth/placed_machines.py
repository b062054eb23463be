"""Machines written anywhere: turned, mirrored, shifted, in other units, under other names, in another order.

Geometry is written in one frame and put where `Writing` says; what a machine does there is the same, seen from there.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from pkmcal_cli.base.rotation import Array

_SIZES = {
    "mm": 1e-3,
    "m": 1.0,
    "in": 25.4e-3,
    "N": 1.0,
    "kN": 1e3,
    "lbf": 4.4482216152605,
    "deg": np.pi / 180,
    "rad": 1.0,
}


@dataclass(frozen=True, kw_only=True)
class Writing:
    """How a machine is written: its axes (d, d) and origin (d,) in base axes, m; units; names by plain name."""

    axes: Array
    origin: Array
    length: str = "mm"
    angle: str = "deg"
    force: str = "N"
    names: Mapping[str, str] = field(default_factory=dict)
    backwards: bool = False

    def value(self, si: float, *units: str) -> str:
        """A number in the file's units, to the last digit: `length`, `force`, `angle`, per another one with `/`."""
        for unit in units:
            size = _SIZES[getattr(self, unit.lstrip("/"))]
            si = si * size if unit.startswith("/") else si / size
        return f"{si:.17g}"

    def point(self, *place: float | tuple[str, float]) -> str:
        """A point (m) of the base; a component can be a parameter and its nominal value."""
        return self._vector(place, self.origin)

    def offset(self, *place: float) -> str:
        """A vector (m) between points."""
        return self._vector(place, np.zeros(len(self.axes)))

    def direction(self, *axis: float) -> str:
        return "[" + ", ".join(f"{v:.17g}" for v in self.axes @ np.array(axis)) + "]"

    def _vector(self, place: Sequence[float | tuple[str, float]], origin: Array) -> str:
        fixed = np.array([0.0 if isinstance(p, tuple) else p for p in place])
        moved = self.axes @ fixed + origin
        parts = []
        for row, constant in zip(self.axes, moved, strict=True):
            terms = [f"({c:.17g})*{self.name(p[0])}" for c, p in zip(row, place, strict=True) if isinstance(p, tuple)]
            parts.append(
                " + ".join([*terms, f"({self.value(constant, 'length')})"]) if terms else self.value(constant, "length")
            )
        return "[" + ", ".join(parts) + "]"

    def name(self, plain: str) -> str:
        """What a parameter, drive, bar ... is called."""
        return self.names.get(plain, plain)

    def section(self, key: str, entries: Mapping[str, str]) -> str:
        """A section of the file, its entries in this order or the other way round."""
        lines = [f"  {self.name(name)}: {text}" for name, text in entries.items()]
        return f"{key}:\n" + "\n".join(reversed(lines) if self.backwards else lines) + "\n"

    def machine(self, *sections: str, space: str, gravity: Sequence[float]) -> str:
        """The file."""
        pull = self.axes @ np.array(gravity)
        head = [
            f"units: {{length: {self.length}, angle: {self.angle}, force: {self.force}}}\n",
            f"space: {space}\n",
            f"gravity: [{', '.join(f'{g:.17g} m/s^2' for g in pull)}]\n",
        ]
        return "".join([*head, *(reversed(sections) if self.backwards else sections)])

    def parameters(self, values: Mapping[str, tuple[float, float, tuple[str, ...]]]) -> str:
        """Nominal values and ranges, SI, and the units in which they are written."""
        entries = {}
        for name, (nominal, spread, units) in values.items():
            unit = "*".join(getattr(self, u) for u in units if u[0] != "/")
            unit += "".join(f"/{getattr(self, u[1:])}" for u in units if u[0] == "/")
            entries[name] = (
                f"{{nominal: {self.value(nominal, *units)}, range: {self.value(spread, *units)}, unit: {unit}}}"
            )
        return self.section("parameters", entries)


LENGTH, STIFFNESS, MM = ("length",), ("force", "/length"), 1e-3


def plane(w: Writing) -> str:
    """A heavy plate on three legs and a carriage with a rod: three freedoms, four drives."""
    n = w.name
    plate = {"P1": (-0.1, 0.08), "P2": (0.12, -0.02), "P3": (0.03, 0.1), "P4": (-0.1, 0.05), "tool": (0.05, 0.11)}
    points = ", ".join(f"{n(k)}: {w.offset(*p)}" for k, p in plate.items())
    slide = f"{{{n('C')}: {w.offset(0, 0)}}}"
    ground = {"B1": w.point(-0.5, -0.4), "B2": w.point(("ax", 0.5), ("ay", -0.4)), "B3": w.point(0.5, 0.4)}
    lengths = {"ax": 0.5, "ay": -0.4, "o1": 0.1, "o2": 0.1, "rod": 0.4}
    return w.machine(
        w.parameters({**{k: (v, MM, LENGTH) for k, v in lengths.items()}, "k": (40e6, 8e6, STIFFNESS)}),
        w.section("ground", ground),
        w.section("guides", {"rail": f"{{at: {w.point(-0.35, 0.2)}, along: {w.direction(0.6, 0.8)}}}"}),
        w.section(
            "bodies",
            {
                "plate": f"{{at: {w.point(0, 0)}, mass: 30, points: {{{points}}}}}",
                "slide": f"{{guide: {n('rail')}, at: {w.value(0.305, 'length')}, points: {slide}}}",
            },
        ),
        w.section(
            "bars",
            {
                **{f"leg{i}": f"{{between: [{n(f'B{i}')}, {n(f'P{i}')}], k: {n('k')}}}" for i in (1, 2, 3)},
                "link": f"{{between: [{n('C')}, {n('P4')}], length: {n('rod')}, k: {n('k')}}}",
            },
        ),
        w.section(
            "actuators",
            {
                "q1": f"{{drives: {n('leg1')}, offset: {n('o1')}}}",
                "q2": f"{{drives: {n('leg2')}, offset: {n('o2')}}}",
                "q3": f"{{drives: {n('leg3')}, offset: {w.value(0.1, 'length')}}}",
                "q4": f"{{moves: {n('slide')}, redundant: true}}",
            },
        ),
        w.section("sensors", {"t": f"{{at: {n('tool')}, reads: [x, y, rz], frame: machine, sigma: {_SIGMA}}}"}),
        space="planar", gravity=(1.0, -9.6),
    )  # fmt: skip


_SIGMA = "{position: 1 um, orientation: 1 urad}"
_BASE = ((400, -45), (400, 45), (400, 75), (400, 165), (400, 195), (400, 285))
_TOP = ((150, -15), (150, 15), (150, 105), (150, 135), (150, 225), (150, 255))


def _ring(polar: Sequence[tuple[float, float]], height: float) -> list[tuple[float, float, float]]:
    turned = [(r * MM, np.deg2rad(a)) for r, a in polar]
    return [(float(r * np.cos(a)), float(r * np.sin(a)), height) for r, a in turned]


def space(w: Writing) -> str:
    """A heavy platform on six legs and a carriage with a rod: six freedoms, seven drives."""
    n = w.name
    ground = {f"B{i}": w.point(*p) for i, p in enumerate(_ring(_BASE, 0.0), 1)}
    ground["B1"] = w.point(("ax", _ring(_BASE, 0.0)[0][0]), ("ay", _ring(_BASE, 0.0)[0][1]), 0.0)
    plate = {f"P{i}": p for i, p in enumerate(_ring(_TOP, 0.0), 1)} | {
        "P7": (-0.05, -0.09, 0.02),
        "tool": (0.03, 0.02, 0.1),
    }
    points = ", ".join(f"{n(k)}: {w.offset(*p)}" for k, p in plate.items())
    slide = f"{{{n('C')}: {w.offset(0, 0, 0)}}}"
    lengths = {"ax": _ring(_BASE, 0.0)[0][0], "ay": _ring(_BASE, 0.0)[0][1], "o1": 0.1, "o2": 0.1, "rod": 0.45}
    drives = {f"q{i}": f"{{drives: {n(f'leg{i}')}, offset: {w.value(0.1, 'length')}}}" for i in range(3, 7)}
    return w.machine(
        w.parameters({**{k: (v, MM, LENGTH) for k, v in lengths.items()}, "k": (40e6, 8e6, STIFFNESS)}),
        w.section("ground", ground),
        w.section("guides", {"rail": f"{{at: {w.point(-0.3, -0.2, 0.1)}, along: {w.direction(0.36, 0.48, 0.8)}}}"}),
        w.section(
            "bodies",
            {
                "plate": f"{{at: {w.point(0, 0, 0.5)}, mass: 60, points: {{{points}}}}}",
                "slide": f"{{guide: {n('rail')}, at: {w.value(0.05, 'length')}, points: {slide}}}",
            },
        ),
        w.section(
            "bars",
            {
                **{f"leg{i}": f"{{between: [{n(f'B{i}')}, {n(f'P{i}')}], k: {n('k')}}}" for i in range(1, 7)},
                "link": f"{{between: [{n('C')}, {n('P7')}], length: {n('rod')}, k: {n('k')}}}",
            },
        ),
        w.section(
            "actuators",
            {
                "q1": f"{{drives: {n('leg1')}, offset: {n('o1')}}}",
                "q2": f"{{drives: {n('leg2')}, offset: {n('o2')}}}",
                **drives,
                "q7": f"{{moves: {n('slide')}, redundant: true}}",
            },
        ),
        w.section(
            "sensors", {"t": f"{{at: {n('tool')}, reads: [x, y, z, rx, ry, rz], frame: machine, sigma: {_SIGMA}}}"}
        ),
        space="spatial", gravity=(1.0, 2.0, -9.5),
    )  # fmt: skip
