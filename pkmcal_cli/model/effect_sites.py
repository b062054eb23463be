"""Where effects can enter a compiled machine: sockets of the ports, by name of the place; effects put into them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace

import numpy as np

from pkmcal_cli.base.rotation import Array
from pkmcal_cli.effects import Effect, Port
from pkmcal_cli.mechanism.topology import Index

_FELT = 1e-12  # m, rad, ... at effects of the size of one: less is rounding
NONE: Index = np.zeros(0, dtype=np.intp)


@dataclass(frozen=True, kw_only=True)
class Socket:
    """Slots that one port displaces by numbers d (W,): slots += matrix d, or slots *= exp(matrix d) where `scales`.

    The rest is what formulas may ask for: the drive, the member (group, element), a length (m), the place (m), the
    share of gravity along the port's directions. `part`: name of a temperature column.
    """

    part: str
    slots: Index = field(default_factory=lambda: NONE)  # (K,)
    matrix: Array = field(default_factory=lambda: np.zeros((0, 0)))  # (K, W)
    scales: bool = False
    actuator: int = -1
    member: tuple[int, int] = (-1, -1)
    length: float = 1.0
    at: Array = field(default_factory=lambda: np.zeros(3))
    down: Array = field(default_factory=lambda: np.zeros(3))
    kind: str = "linear"  # of a drive: linear, rotary, spool
    period: float = float("nan")  # lead of its screw or period of its encoder, m or rad of travel

    @property
    def place(self) -> tuple[int, int, int]:
        """What tells the forces of sockets apart: the drive, the member."""
        return (self.actuator, *self.member)


Sockets = Mapping[Port, Mapping[str, tuple[Socket, ...]]]
"""By port and name of the place; a place may have several sockets (carriages of a guide, pieces of a beam)."""


@dataclass(frozen=True)
class PlacedEffect:
    """An effect at a place; `parameters`: full names, in the order of the effect's; `options` in SI."""

    effect: Effect
    at: str
    sockets: tuple[Socket, ...]
    parameters: tuple[str, ...]
    options: Mapping[str, tuple[float, ...]]
    session: str = ""  # in whose rows it acts; "": in all

    @property
    def name(self) -> str:
        """`KEYWORD@PLACE`."""
        return f"{self.effect.keyword}@{self.at}" + (f"[{self.session}]" if self.session else "")

    def of_session(self, session: str) -> PlacedEffect:
        """Its instance for a session, with parameters of its own."""
        return replace(self, parameters=tuple(f"{p}[{session}]" for p in self.parameters), session=session)


@dataclass(frozen=True)
class AtSocket:
    """What formulas may ask for that is the same in every row."""

    socket: Socket

    @property
    def length(self) -> float:
        """Nominal length of the member, or radius of the spool, m."""
        return self.socket.length

    @property
    def at(self) -> Array:
        """Place (3,) of a base point."""
        return self.socket.at

    @property
    def down(self) -> Array:
        """Gravity along the port's directions."""
        return self.socket.down


@dataclass(frozen=True)
class _Ordinary(AtSocket):
    """What formulas may ask for in an ordinary row: nothing is zero by chance; see `effects.Inputs`."""

    rows: int = 1
    travel = share = reading = warmth = time = moment = payload = spindle = pull = np.array([0.7])
    direction = np.array([1.0])
    chord = np.array([[0.48, 0.6, 0.64]])

    def lagged(self, tau: float) -> Array:
        return self.warmth

    def option(self, name: str) -> float:
        return 1.9


def _acts(effect: Effect, socket: Socket) -> bool:
    """Whether an effect displaces a socket at all: sag needs gravity across the guide, growth something that grows."""
    sizes = [0.3 + 0.1 * k for k in range(len(effect.parameters))]
    moved = effect.displacement(_Ordinary(socket), sizes, planar=False) @ socket.matrix.T
    return bool(np.abs(moved).max(initial=0.0) > _FELT)


def places(sockets: Sockets, effect: Effect, sessions: tuple[str, ...] = ()) -> dict[str, tuple[Socket, ...]]:
    """Where an effect can sit and does something, by name; `all` where it can be the same at several places."""
    named = {
        name: fitting
        for name, found in sockets.get(effect.port, {}).items()
        if (fitting := tuple(s for s in found if effect.where in ("any", s.kind) and _acts(effect, s)))
    }
    everywhere = tuple(s for found in named.values() for s in found)
    if effect.places == "session":
        return dict.fromkeys(sessions if everywhere else (), everywhere)
    if effect.places == "all":
        return {"all": everywhere} if everywhere else {}
    if effect.common and len(named) > 1:
        named["all"] = everywhere
    return named
