"""What an effect is: where it enters the model, its parameters, and how far it moves what it enters.

An effect is data: an entry, a formula and its texts. The formula gives the displacement of the entry in every row as a
function of the effect's parameters; it is analytic, so that derivatives come from complex steps, and it is zero where
the parameters have their null value, 0.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Collection, Iterator, Mapping
from dataclasses import dataclass
from itertools import count, islice
from typing import TYPE_CHECKING, Any, Literal, Protocol

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    Array = NDArray[np.float64]

Entry = Literal[
    "command",  # position that a drive takes, m or rad
    "drive_force",  # force of a force-controlled drive, N or N m
    "length",  # unstressed length of a bar, rope or beam, m
    "guide",  # place of the carriages of a guide across it, m
    "carriage",  # rotation of a carriage on its guide, rad
    "base",  # place of a point, frame or guide fixed to the base, m
    "tool",  # place of what a sensor sees in its body's axes, m
    "stiffness",  # logarithm of a stiffness
    "weight",  # all weights, as a share
    "load",  # force at what the first sensor sees, N
    "frame",  # of what a sensor reads: its frame, its base point, its number; see `FRAME_PARTS`
]
"""Where effects enter the model: all but `frame` are coefficients of the engine."""

ENTRIES: dict[Entry, str] = {
    "command": "position of a drive", "drive_force": "force of a force-controlled drive",
    "length": "length of a bar, rope or beam", "guide": "position of the carriages across a guide",
    "carriage": "rotation of a carriage", "base": "position of a base point, frame or guide",
    "tool": "position of the point that a sensor measures", "stiffness": "stiffness of a member, joint or drive",
    "weight": "all weights", "load": "force at the point of the first sensor", "frame": "what a sensor reads",
}  # fmt: skip
"""The entries in words."""

ABSENT: dict[Entry, str] = {
    "command": "no drive", "drive_force": "no force-controlled drive", "length": "no bar, rope or beam",
    "guide": "no drive moves a carriage on a guide", "carriage": "no carriage whose rotation moves a joint",
    "base": "nothing is joined to the base", "tool": "no sensor looks at a point of the machine",
    "stiffness": "no part yields", "weight": "no part has a mass", "load": "no sensor looks at a point of the machine",
    "frame": "no sensor looks at a point of the machine",
}  # fmt: skip
"""What a machine lacks where nothing can enter."""

KINDS: dict[Kind, str] = {
    "any": "", "linear": "no drive moves along a line", "rotary": "no drive turns", "spool": "no drive winds a spool",
    "coordinates": "no sensor reads coordinates", "length": "no sensor reads a length",
}  # fmt: skip
"""What a machine lacks where its drives and sensors are of another kind."""

WIDTHS: dict[Entry, int] = {
    "command": 1, "drive_force": 1, "length": 1, "guide": 1, "carriage": 1, "base": 3, "tool": 3, "stiffness": 1,
    "weight": 1, "load": 3, "frame": 14,
}  # fmt: skip
"""Numbers that displace an entry."""

FRAME_PARTS = {
    "shift": slice(0, 3), "turn": slice(3, 6), "scale": slice(6, 7), "shear": slice(7, 10), "base": slice(10, 13),
    "reading": slice(13, 14),
}  # fmt: skip
"""The numbers of the entry `frame`, of which a kind of sensor feels some: translation (m) and rotation (rad) of the
coordinates, scale, shear, place of the other end of a distance (m), shift of a single number (m or rad)."""

Kind = Literal["any", "linear", "rotary", "spool", "coordinates", "length"]
Column = Literal["time", "temperature", "direction", "payload", "session", "spindle", "force"]
Stage = Literal["command", "geometry", "stiffness", "load", "reading"]
STAGES: dict[Entry, Stage] = {
    "command": "command", "drive_force": "command", "length": "geometry", "guide": "geometry", "carriage": "geometry",
    "base": "geometry", "tool": "geometry", "stiffness": "stiffness", "weight": "load", "load": "load",
    "frame": "reading",
}  # fmt: skip
"""The stage of the prediction that an entry belongs to."""


class Inputs(Protocol):
    """What a formula may use: arrays (N,) over the rows of the whole table, at one place."""

    @property
    def rows(self) -> int: ...
    @property
    def travel(self) -> Array: ...  # of the drive from its reading zero, m or rad
    @property
    def normalised_travel(self) -> Array: ...  # place in the travel `over`, -1 ... 1
    @property
    def centred_travel(self) -> Array: ...  # of the drive from the middle of the travel `over`, m or rad
    @property
    def direction(self) -> Array: ...  # of the last motion of the drive, -1, 0, 1
    @property
    def motion(self) -> Array: ...  # the same along its travel, against which readings may count
    @property
    def temperature_rise(self) -> Array: ...  # temperature above `reference`, K
    def lagged(self, tau: Any) -> Array: ...  # the same behind a first-order lag of tau, s
    @property
    def time(self) -> Array: ...  # s
    @property
    def normalised_time(self) -> Array: ...  # place in the time `during`, -1 ... 1
    @property
    def payload(self) -> Array: ...  # kg
    @property
    def spindle(self) -> Array: ...  # angle of the spindle, rad
    @property
    def commanded_force(self) -> Array: ...  # of a force-controlled drive, by its column, N or N m
    @property
    def pull(self) -> Array: ...  # force of the earlier pass in the member or of the drive, N (tension positive)
    @property
    def chord(self) -> Array: ...  # (N, 3) unit vector along the member in the earlier pass, base axes
    @property
    def length(self) -> Array | float: ...  # nominal, of the member, (N,) of a telescopic leg; radius of the spool, m
    @property
    def folds(self) -> float: ...  # line that a spool winds per travel of its rope
    @property
    def at(self) -> Array: ...  # (3,) place of a base point, m
    @property
    def down(self) -> Array: ...  # (3,) unit vector of gravity, base axes
    def option(self, name: str) -> float: ...


Formula = Callable[..., Any]
"""(Inputs, *parameters) -> displacement (N,) of entries of width 1, else a sequence of arrays or numbers 0, one
each.
"""


@dataclass(frozen=True, kw_only=True)
class EffectParameter:
    """A parameter: `range` in `unit` is the half-width of what is plausible, two standard deviations; null is 0.

    `rotary`: the unit where the drive turns, `turning`: the range then, in it; `spatial`: only in space; `free`: fitted
    with the others, but no part of the effect, which nobody infers from it; `possible`: the interval, in `unit`, out of
    which no value can be; `known`: its value, in `unit`, wherever the effect acts, unless it is identified, `known_as`:
    in words; `order`: in which it is needed: often an effect is told by its numbers of the lowest orders alone.
    """

    name: str
    unit: str
    range: float
    text: str
    rotary: str | None = None
    spatial: bool = False
    turning: float | None = None
    free: bool = False
    possible: tuple[float, float] = (-math.inf, math.inf)
    known: float | None = None
    known_as: str = ""
    order: int = 0

    def range_in(self, rotary: bool) -> float:
        """What is plausible, in the unit of a drive that turns or moves."""
        return self.turning if rotary and self.turning is not None else self.range


@dataclass(frozen=True, kw_only=True)
class Option:
    """A constant of an effect, not identified: a value with a unit, or an interval; `needed` if it has no default.

    `positive`: whether its value must be.
    """

    name: str
    unit: str
    text: str
    interval: bool = False
    needed: bool = False
    rotary: str | None = None
    positive: bool = False


OVER = Option(
    name="over",
    unit="mm",
    text="travel that the shape covers; default: the limits, else the travel in the table",
    interval=True,
    rotary="deg",
)
DURING = Option(
    name="during", unit="s", text="time that the shape covers; default: the time in the table", interval=True
)


@dataclass(frozen=True, kw_only=True)
class Effect:
    """A named physical effect; texts may contain {at}, {size} and {repeats}, how often its error comes in a period."""

    keyword: str
    title: str  # the field's standard term
    symbol: str  # ISO 230, ISO 841; "" without one
    source: str
    enters: Entry
    parameters: tuple[EffectParameter, ...]
    formula: Formula
    cause: str
    result: str
    action: str
    needs: tuple[Column, ...] = ()
    options: tuple[Option, ...] = ()
    places: Literal["each", "all", "session"] = "each"  # one hypothesis per place, only all together, per session
    where: Kind = "any"  # which places of the entry
    common: bool = True  # also a hypothesis: the same at all places
    by_session: bool = False  # also a hypothesis: at one place in one session
    measurement: bool = False  # a fault of the measurement, not of the machine
    reactive: bool = False  # needs the forces of an earlier pass
    weighty: bool = False  # acts by gravity: nothing without it
    negative: str = ""  # what a size below 0 is, where that is not what the title says
    nowhere: str = ""  # why it acts at none of its places, where that may be
    any_curve: bool = False  # over the travel, by definition: its formula is only the usual one
    proportional: bool = False  # to the travel: what bends it more than a little has another name
    harmonics: bool = False  # its orders, 0 and 1, come once and twice per period, and each may be there alone
    row_by_row: bool = False  # its formula takes numbers that differ from row to row, (N,), as sessions have them

    @property
    def turns_units(self) -> bool:
        """Whether its numbers are others, with other units, where a drive turns."""
        return any(p.rotary is not None for p in self.parameters)

    def used(self, planar: bool) -> tuple[EffectParameter, ...]:
        """Parameters in a plane or in space."""
        return tuple(p for p in self.parameters if not (planar and p.spatial))

    def repeats(self, names: Collection[str]) -> str:
        """How often some of its numbers (`pitch@q1.c2`) come: "twice per period"; "" of effects without harmonics."""
        if not self.harmonics:
            return ""
        numbers = {name.rpartition(".")[2] for name in names}
        orders = sorted({p.order for p in self.parameters if p.name in numbers})
        return f"{' and '.join(('once', 'twice')[k] for k in orders)} per period"

    def displacement(self, at: Inputs, values: Mapping[str, Any]) -> NDArray[Any]:
        """Displacement (N, W) of the entry at values of parameters by name (SI, real or complex), null without."""
        import numpy as np  # imported late: reading a machine file does not need it

        moved = self.formula(at, *(values.get(p.name, 0.0) for p in self.parameters))
        parts = [moved] if WIDTHS[self.enters] == 1 else list(moved)
        out = np.empty((at.rows, len(parts)), dtype=complex if any(map(np.iscomplexobj, parts)) else float)
        for k, part in enumerate(parts):
            out[:, k] = part
        return out


def legendre(u: Array, degree: int) -> Array:
    """Legendre polynomial of a degree at u (N,)."""
    return next(islice(legendres(u), degree, None))


def legendres(u: Array) -> Iterator[Array]:
    """Legendre polynomials of all degrees from 0 on, at u (N,)."""
    before, current = u * 0 + 1.0, u
    yield before
    for k in count(1):
        yield current
        before, current = current, ((2 * k + 1) * u * current - k * before) / (k + 1)
