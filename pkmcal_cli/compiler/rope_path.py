"""A rope as links: from point to point, over pulleys where it has any, and how long it is as drawn.

In the plane a pulley shapes the links on both its sides. In space it swivels about its axis: it shapes the link on one
side, and on the other the rope comes along the axis from a point of the same body, or from beyond its end.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from pkmcal_cli.base.rotation import Array
from pkmcal_cli.compiler.coefficient_values import combined, constant_vector, number, triad_about, unit
from pkmcal_cli.compiler.structure import Structure
from pkmcal_cli.elements import BarElement, LinkGeometry, PlanarPulleyElement, SwivelPulleyElement
from pkmcal_cli.language.machine import Machine, Pulley, Rope, axis_vector
from pkmcal_cli.mechanism.coefficients import Formula
from pkmcal_cli.mechanism.connection_points import ConnectionPoint, Link, Number

BASE = ""  # what carries ground points and whatever is fixed
_WHOLE = 1e-9  # rad: what is missing to a whole turn is rounding
Function = Callable[[Any], Any]
Shaped = BarElement | PlanarPulleyElement | SwivelPulleyElement


def carrier(machine: Machine, point: str) -> str:
    """The body or node that carries a point; `BASE` for what is fixed."""
    if point in machine.ground:
        return BASE
    owner = next((name for name, body in machine.bodies.items() if point in body.points), point)
    owning = machine.bodies.get(owner) or machine.nodes[owner]
    return BASE if len(owning.fixed) >= (3 if machine.space == "planar" else 6) else owner


def swivels_towards(machine: Machine, rope: Rope, visit: int) -> int | None:
    """The side, -1 or 1, on which a pulley in space guides the rope; None where that is not clear.

    On the other side its neighbour is a point of the same body, or there is none.
    """
    body, last = carrier(machine, rope.between[visit]), len(rope.between) - 1
    led = [
        side
        for side in (-1, 1)
        if not 0 <= visit + side <= last or carrier(machine, rope.between[visit + side]) == body
    ]
    return -led[0] if len(led) == 1 else None


@dataclass(frozen=True, kw_only=True)
class RopePath:
    """The links of one rope; ends: which of its points each joins, first its point i."""

    rope: Rope
    links: tuple[Link, ...]
    ends: tuple[tuple[int, int], ...]
    shape: Shaped
    geometry: LinkGeometry  # in the reference configuration at nominal parameters, one row

    @property
    def free(self) -> Array:
        """Lengths (K,) of what lies on no pulley, in the reference configuration, m; nan without a tangent."""
        return np.asarray(self.shape.free_length(self.geometry)[0])

    @property
    def lengths(self) -> Array:
        """Lengths (K,) with what lies on the pulleys at points i, m."""
        return np.asarray(self.shape.evaluate(self.geometry, np.zeros((1, 1, 1)))[0][0, :, 0])

    @property
    def shares(self) -> Array:
        """Parts of the rope's length (V,) that hang at the points over which it runs."""
        out = np.zeros(len(self.rope.between))
        for (first, last), length, free in zip(self.ends, self.lengths, self.free, strict=True):
            out[first] += length - 0.5 * free
            out[last] += 0.5 * free
        return np.asarray(out / out.sum())


def rope_path(structure: Structure, rope: Rope, weight: float = 1.0, shape: Shaped | None = None) -> RopePath:
    """The links of a rope; `shape`: what its links are, where other ropes of one cable decide it."""
    shape = shape or shape_of(structure.planar, [rope])
    connections = [structure.connection(point) for point in rope.between]
    if isinstance(shape, SwivelPulleyElement):
        ends = _swivelled_ends(structure.machine, rope)
        links = [_swivelled(structure, rope, pair, connections) for pair in ends]
    else:
        ends = [(k, k + 1) for k in range(len(connections) - 1)]
        sizes = _planar_sizes(structure, rope, connections) if shape.sizes else [()] * len(ends)
        pairs = [(connections[i], connections[j]) for i, j in ends]
        links = [Link(connections=pair, sizes=s) for pair, s in zip(pairs, sizes, strict=True)]
    made = tuple(replace(link, weight=weight) for link in links)
    geometry = drawn_links(structure, made)(structure.nominal)
    return RopePath(rope=rope, links=made, ends=tuple(ends), shape=shape, geometry=geometry)


def shape_of(planar: bool, ropes: Sequence[Rope]) -> Shaped:
    """What the links of ropes are."""
    if not any(rope.pulleys for rope in ropes):
        return BarElement()
    return PlanarPulleyElement() if planar else SwivelPulleyElement()


def reference_length(structure: Structure, shape: Shaped, links: Sequence[Link]) -> Number:
    """Weighted length of links in the reference configuration, as a function of the parameters that place them."""
    b = structure.builder
    formulas = dict(b.formulas)
    offsets = {k for l in links for p in l.connections for _, _, index in p.point.offsets for k in b.offsets[index]}
    parts = [formulas[k] for k in sorted(offsets) if k in formulas]
    parts += [size for link in links for size in link.sizes if isinstance(size, Formula)]
    names = tuple(dict.fromkeys(n for part in parts for n in part.names))
    weights, geometry = np.array([link.weight for link in links]), drawn_links(structure, links)

    def length(parameters: Mapping[str, complex]) -> complex:
        return complex(shape.evaluate(geometry(parameters), np.zeros((1, 1, 1)))[0][0, :, 0] @ weights)

    return Formula(names, length) if names else float(np.real(length({})))


# --- in the plane --------------------------------------------------------------------------
def _planar_sizes(structure: Structure, rope: Rope, connections: Sequence[ConnectionPoint]) -> list[tuple[Number, ...]]:
    """Signed radii at both ends of each link, its direction, and the wrap on its first pulley (rad, signed)."""
    radii = [_signed(rope.pulleys.get(point)) for point in rope.between]
    rho = [float(np.real(r.function(structure.nominal))) if isinstance(r, Formula) else r for r in radii]
    places = [structure.position(c.point) for c in connections]
    angles = [planar_direction(b - a, r, s) for a, b, r, s in zip(places, places[1:], rho, rho[1:], strict=False)]
    wraps = [0.0] + [_wrap(before, after, r) for before, after, r in zip(angles, angles[1:], rho[1:], strict=False)]
    return [(radii[k], radii[k + 1], angle, wrap) for k, (angle, wrap) in enumerate(zip(angles, wraps, strict=True))]


def _signed(pulley: Pulley | None) -> Number:
    """Radius, positive with the centre to the left of the rope."""
    if pulley is None:
        return 0.0
    return number(pulley.radius) if pulley.side == "left" else combined(lambda r: -r, pulley.radius)


def planar_direction(delta: Array, first: float, last: float) -> float:
    """Angle (rad) of the common tangent of two circles with signed radii, delta (3,) apart; nan where there is none."""
    apart = last - first
    square = float(delta @ delta) - apart**2
    free = np.sqrt(square) if square > 0 else np.nan
    return float(np.arctan2(delta[1], delta[0]) - np.arctan2(apart, free))


def _wrap(before: float, after: float, radius: float) -> float:
    """Angle (rad) on a pulley between two directions, of the sign of its radius, less than a turn."""
    if radius == 0:
        return 0.0
    swept = float((np.sign(radius) * (after - before)) % (2 * np.pi))
    return float(np.sign(radius)) * (0.0 if 2 * np.pi - swept < _WHOLE else swept)


# --- in space ------------------------------------------------------------------------------
def _swivelled_ends(machine: Machine, rope: Rope) -> list[tuple[int, int]]:
    """Visits of each link, that of a pulley which guides it first."""
    guided = {v: swivels_towards(machine, rope, v) for v, point in enumerate(rope.between) if point in rope.pulleys}
    return [(k + 1, k) if guided.get(k + 1) == -1 else (k, k + 1) for k in range(len(rope.between) - 1)]


def _swivelled(structure: Structure, rope: Rope, ends: tuple[int, int], connections: Sequence[ConnectionPoint]) -> Link:
    """A link with its pulley, or straight."""
    first, last = (connections[visit] for visit in ends)
    pulley = rope.pulleys.get(rope.between[ends[0]])
    if pulley is None or swivels_towards(structure.machine, rope, ends[0]) != ends[1] - ends[0]:
        along = structure.position(last.point) - structure.position(first.point)
        radius: Number = 0.0
    else:
        along, radius = pulley_axis(structure, pulley), number(pulley.radius)
    triad = triad_about(along) if along.any() else np.eye(3)
    return Link(
        connections=(first, last), triads=(structure.orientation(first.rotation).T @ triad, np.eye(3)), sizes=(radius,)
    )


def pulley_axis(structure: Structure, pulley: Pulley) -> Array:
    """Unit vector (3,) along the axis about which a pulley swivels, base axes."""
    assert pulley.axis is not None
    return unit(constant_vector(axis_vector(pulley.axis, 3), structure.nominal))


def drawn_links(structure: Structure, links: Sequence[Link]) -> Callable[[Mapping[str, Any]], LinkGeometry]:
    """What links are in the reference configuration at (possibly complex) parameters, as one row."""
    triads = [
        [structure.orientation(c.rotation) @ t for c, t in zip(link.connections, link.triads, strict=True)]
        for link in links
    ]
    ti, tj = np.moveaxis(np.array(triads)[None], 2, 0)
    fixed, moved = _vectors(structure, links)

    def geometry(parameters: Mapping[str, Any]) -> LinkGeometry:
        delta = sum((function(parameters) * slope for function, slope in moved), start=fixed)
        sizes = [[s.function(parameters) if isinstance(s, Formula) else s for s in link.sizes] for link in links]
        return LinkGeometry(delta[None], ti, tj, np.array(sizes)[None])

    return geometry


def _vectors(structure: Structure, links: Sequence[Link]) -> tuple[Array, list[tuple[Function, Array]]]:
    """Vectors (K, 3) from points i to points j: what is constant, and slopes (K, 3) by what depends on parameters."""
    b = structure.builder
    formulas = dict(b.formulas)
    fixed, slopes = np.zeros((len(links), 3)), dict[int, Array]()
    for k, link in enumerate(links):
        for factor, connection in ((-1.0, link.connections[0]), (1.0, link.connections[1])):
            for r, sign, index in connection.point.offsets:
                for coefficient, along in zip(b.offsets[index], structure.orientation(r).T, strict=True):
                    if coefficient in formulas:
                        slopes.setdefault(coefficient, np.zeros_like(fixed))[k] += factor * sign * along
                    else:
                        fixed[k] += factor * sign * b.constants[coefficient] * along
            for r, t, axis in connection.point.translations:
                fixed[k] += factor * b.translations[t][1] * (structure.orientation(r) @ np.array(axis))
    return fixed, [(formulas[coefficient].function, slope) for coefficient, slope in slopes.items()]
