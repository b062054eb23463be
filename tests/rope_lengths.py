"""Lengths of ropes over pulleys by plane trigonometry: contact points by their angles about the centres, and arcs."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise

import numpy as np

from pkmcal_cli.base.rotation import Array

Circle = tuple[Array, float, str]  # centre, radius, side of the rope on which the centre is


def contacts(first: Circle, last: Circle) -> tuple[float, float]:
    """Angles of the points of contact about both centres: of the outer tangent, or of the inner one."""
    (a, r, side), (b, q, other) = first, last
    way = b - a
    distance, about = float(np.hypot(*way)), float(np.arctan2(way[1], way[0]))
    right = {"left": -1.0, "right": 1.0}[side]  # where the rope is, seen from the centre
    if side == other:
        angle = np.arccos((r - q) / distance)
        return about + right * angle, about + right * angle
    angle = np.arccos((r + q) / distance)
    return about + right * angle, about + np.pi + right * angle


def planar_length(circles: Sequence[Circle], drawn: Sequence[Circle] = ()) -> float:
    """Free parts and arcs of less than a turn; on pulleys at the ends what has been wound since it was `drawn`."""
    pairs = [contacts(*pair) for pair in pairwise(circles)]
    total = 0.0
    for (a, b), (start, end) in zip(pairwise(circles), pairs, strict=True):
        places = [c[0] + c[1] * np.array([np.cos(t), np.sin(t)]) for c, t in ((a, start), (b, end))]
        total += float(np.hypot(*(places[1] - places[0])))
    for (_, radius, side), (_, arrives), (leaves, _) in zip(circles[1:-1], pairs, pairs[1:], strict=False):
        turn = leaves - arrives if side == "left" else arrives - leaves
        total += radius * (turn % (2 * np.pi))
    if len(drawn):
        before = [contacts(*pair) for pair in pairwise(drawn)]
        for end, sign in ((0, 1.0), (-1, -1.0)):
            _, radius, side = circles[end]
            turn = pairs[end][end] - before[end][end]
            turn -= 2 * np.pi * np.round(turn / (2 * np.pi))
            total += radius * sign * (turn if side == "left" else -turn)
    return total


def swivel_length(point: Array, axis: Array, radius: float, end: Array) -> float:
    """Arc and free part of a rope that comes along the axis to a point, over a pulley that swivels, to its end."""
    way = end - point
    height = float(way @ axis)
    outward = float(np.linalg.norm(way - height * axis))
    distance = float(np.hypot(outward - radius, height))
    seen = np.arctan2(height, outward - radius)  # the end from the centre, against the outward direction
    return float(radius * (np.pi - seen - np.arccos(radius / distance)) + np.sqrt(distance**2 - radius**2))
