"""What an effect is: where it enters the model, its parameters, and how far it moves what it enters.

An effect is data: a port, a formula and its texts. The formula gives the displacement of the port in every row as a
function of the effect's parameters; it is analytic, so that derivatives come from complex steps, and it is zero where
the parameters have their null value, 0.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Literal, Protocol

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    Array = NDArray[np.float64]

Port = Literal[
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
    "frame",  # translation (m), rotation (rad) and strain of what a sensor reads
]
"""Where effects enter the model: all but `frame` are slots of the engine."""

PORTS: dict[Port, str] = {
    "command": "position of a drive", "drive_force": "force of a force-controlled drive",
    "length": "length of a bar, rope or beam", "guide": "place of the carriages across a guide",
    "carriage": "turn of a carriage", "base": "place of a point, frame or guide of the base",
    "tool": "place of what a sensor sees", "stiffness": "a stiffness", "weight": "all weights",
    "load": "force at what the first sensor sees", "frame": "what a sensor reads",
}  # fmt: skip
"""The ports in words."""

WIDTHS: dict[Port, int] = {
    "command": 1, "drive_force": 1, "length": 1, "guide": 1, "carriage": 1, "base": 3, "tool": 3, "stiffness": 1,
    "weight": 1, "load": 3, "frame": 10,
}  # fmt: skip
"""Numbers that displace a port; `frame`: 3 of translation, 3 of rotation, scale, 3 of shear."""

Column = Literal["time", "temperature", "direction", "payload", "session", "spindle"]
Stage = Literal["command", "geometry", "stiffness", "load", "reading"]
STAGES: dict[Port, Stage] = {
    "command": "command", "drive_force": "command", "length": "geometry", "guide": "geometry", "carriage": "geometry",
    "base": "geometry", "tool": "geometry", "stiffness": "stiffness", "weight": "load", "load": "load",
    "frame": "reading",
}  # fmt: skip
"""The stage of the prediction that a port belongs to."""


class Inputs(Protocol):
    """What a formula may use: arrays (N,) over the rows of the whole table, at one place."""

    @property
    def rows(self) -> int: ...
    @property
    def travel(self) -> Array: ...  # of the drive from its reading zero, m or rad
    @property
    def share(self) -> Array: ...  # place in the travel `over`, -1 ... 1
    @property
    def reading(self) -> Array: ...  # of the drive's encoder, m or rad
    @property
    def direction(self) -> Array: ...  # of the last motion of the drive, -1, 0, 1
    @property
    def warmth(self) -> Array: ...  # temperature above `reference`, K
    def lagged(self, tau: Any) -> Array: ...  # the same behind a first-order lag of tau, s
    @property
    def time(self) -> Array: ...  # s
    @property
    def moment(self) -> Array: ...  # place in the time `during`, -1 ... 1
    @property
    def payload(self) -> Array: ...  # kg
    @property
    def spindle(self) -> Array: ...  # angle of the spindle, rad
    @property
    def pull(self) -> Array: ...  # force of the earlier pass in the member or of the drive, N (tension positive)
    @property
    def chord(self) -> Array: ...  # (N, 3) unit vector along the member in the earlier pass, base axes
    @property
    def length(self) -> float: ...  # nominal, of the member; radius of the spool, m
    @property
    def at(self) -> Array: ...  # (3,) place of a base point, m
    @property
    def down(self) -> Array: ...  # (3,) unit vector of gravity, base axes
    def option(self, name: str) -> float: ...


Formula = Callable[..., Any]
"""(Inputs, *parameters) -> displacement (N,) of ports of width 1, else a sequence of arrays or numbers 0, one each."""


@dataclass(frozen=True, kw_only=True)
class EffectParameter:
    """A parameter: `range` in `unit` is the half-width of what is plausible, two standard deviations; null is 0.

    `rotary`: the unit where the drive turns, `turning`: the range then, in it; `spatial`: only in space; `possible`:
    the interval, in `unit`, out of which no value can be.
    """

    name: str
    unit: str
    range: float
    text: str
    rotary: str | None = None
    spatial: bool = False
    turning: float | None = None
    possible: tuple[float, float] = (-math.inf, math.inf)

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


@dataclass(frozen=True, kw_only=True)
class Effect:
    """A named physical effect; texts may contain {at} and {size}."""

    keyword: str
    title: str  # the field's standard term
    symbol: str  # ISO 230, ISO 841; "" without one
    source: str
    port: Port
    parameters: tuple[EffectParameter, ...]
    formula: Formula
    cause: str
    result: str
    action: str
    needs: tuple[Column, ...] = ()
    options: tuple[Option, ...] = ()
    places: Literal["each", "all", "session"] = "each"  # one hypothesis per place, only all together, per session
    where: Literal["any", "linear", "rotary", "spool", "moving"] = "any"  # which places of the port
    common: bool = True  # also a hypothesis: the same at all places
    measurement: bool = False  # a fault of the measurement, not of the machine
    reactive: bool = False  # needs the forces of an earlier pass

    def used(self, planar: bool) -> tuple[EffectParameter, ...]:
        """Parameters in a plane or in space."""
        return tuple(p for p in self.parameters if not (planar and p.spatial))

    def displacement(self, at: Inputs, values: Sequence[Any], planar: bool) -> NDArray[Any]:
        """Displacement (N, W) of the port at parameter values (SI, real or complex)."""
        given = dict(zip((p.name for p in self.used(planar)), values, strict=True))
        import numpy as np  # imported late: reading a machine file does not need it

        found = self.formula(at, *(given.get(p.name, 0.0) for p in self.parameters))
        parts = [found] if WIDTHS[self.port] == 1 else list(found)
        return np.stack([np.broadcast_to(part, (at.rows,)) for part in parts], axis=1)


def legendre(u: Array, degree: int) -> Array:
    """Legendre polynomial of a degree at u (N,)."""
    before, now = u * 0 + 1.0, u
    for k in range(1, degree):
        before, now = now, ((2 * k + 1) * u * now - k * before) / (k + 1)
    return now if degree else before
