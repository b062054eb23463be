"""Gauge freedoms: motions of the whole base, and its scale, that change nothing that was measured; and their datum.

A direction in which parameters are not seen is a gauge freedom when it moves everything that is fixed to the base like
one rigid body, or stretches it. Which motions these are is found by comparing the null directions of the Jacobian with
the fields t + w x r + s r at the places of the base (free network adjustment: the rank defect of the datum).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from pkmcal_cli.base.rotation import Array, skew
from pkmcal_cli.calibration.held_datum import HeldDatum
from pkmcal_cli.calibration.identifiability import Directions
from pkmcal_cli.calibration.problem import Problem
from pkmcal_cli.model.base import Base
from pkmcal_cli.model.model import Model
from pkmcal_cli.prediction import Request
from pkmcal_cli.prediction.stages import BaseCoefficients, Chain

_SPATIAL = (
    "scale",
    "rotation about x",
    "rotation about y",
    "rotation about z",
    "shift along x",
    "shift along y",
    "shift along z",
)
_PLANAR = ("scale", "rotation about z", "shift along x", "shift along y")
_SAME = 1e-4  # of the largest singular value: fields agree
_MOVED = 1e-3  # of what the ranges do to the base: a null direction that moves it less does not (most are nearly null)
_FELT = 1e-3  # of a motion: shifts, rotations and a scale that have less part in it have none
_CLEARLY, _HARDLY = 0.3, 1e-3  # share of what holding a parameter fixes that others do not
_MUCH, _LITTLE = 1e-2, 1e-3  # of what the most moved parameter moves: what moves less holds the base hardly, or not
_SHARE = 0.05  # a motion is named by the generators that have more than this share of it


@dataclass(frozen=True)
class Gauge:
    """What the data leave free of the base.

    motions: in words, one for each freedom; directions (g, p): of the parameters, in ranges.
    """

    motions: tuple[str, ...]
    directions: Array


def gauge_of(problem: Problem, values: Array, directions: Directions) -> Gauge:
    """Gauge freedoms among the null directions of selected parameters, at parameter values (P,).

    Places that only sensors without readings look at are none of the base.
    """
    nothing = Gauge((), np.zeros((0, len(directions.names))))
    model = problem.model
    base = model.base.felt([s.name for s in model.sensors if problem.measured[:, s.channels].any()])
    if not directions.null.any() or not len(base.places):
        return nothing
    null = directions.vectors[directions.null]  # (k, p) in ranges
    states = _states(problem, values, directions.names)
    motion = np.vstack([base.motion(*state) for state in states]) * directions.ranges  # (f, p)
    size = float(np.abs(motion).max(initial=0.0))
    if size == 0.0:
        return nothing
    moved, much, parts = np.linalg.svd(motion @ null.T / size, full_matrices=False)
    felt = much > _MOVED
    moved, parts = moved[:, felt], parts[felt] / much[felt, None]  # (f, m), (m, k): each moves it by one
    names, fields = _fields(model, base, [c for c, _ in states], scales=not _lengths_read(problem))
    _, s, vt = np.linalg.svd(np.hstack([moved, -fields]), full_matrices=True)
    rank = int((s > _SAME * s[0]).sum())
    kernel = vt[rank:]  # (n, m + generators)
    rigid = kernel[:, moved.shape[1] :]
    freedoms = int(np.linalg.matrix_rank(rigid, tol=_FELT)) if len(kernel) else 0
    if not freedoms:
        return nothing
    words = tuple(_words(names, row) for row in _echelon(rigid)[:freedoms])
    return Gauge(words, _range_of(kernel, moved.shape[1]) @ parts @ null / size)


def _range_of(kernel: Array, count: int) -> Array:
    """Combinations (g, m) of motions of the base that are rigid, one for each independent one."""
    _, s, vt = np.linalg.svd(kernel[:, count:].T, full_matrices=False)
    return np.asarray(vt[s > _FELT] @ kernel[:, :count])


def _lengths_read(problem: Problem) -> bool:
    """Whether drives or instruments read lengths: then nothing has a free scale."""
    read = [a.dimension for a in problem.model.actuators]
    read += [c.dimension for k, c in enumerate(problem.model.channels) if problem.measured[:, k].any()]
    return "length" in read


def _states(problem: Problem, values: Array, names: tuple[str, ...]) -> list[tuple[Array, Array]]:
    """Coefficients (S,) and their derivatives by parameters (S, p): of each session that has its own, else of all rows.

    Places that each session has for itself, of a ball, move with the base. Zeros that it has say where its drives were
    homed, not where the base is: no datum could hold them.
    """
    model, numbers = problem.model, problem.model.by_name(values)
    drives = [d.coefficient for d in model.topology.drives]
    rest = model.topology.coefficients.values(numbers)[drives]
    by_rest = model.topology.coefficients.jacobian(numbers, names)[drives]
    chain = Chain.of(model, values, Request(parameters=names), problem.rows)
    out = []
    for line, jacobian in zip(BaseCoefficients.of(model, values, problem.rows).lines, chain.jacobian, strict=True):
        whole = np.zeros((len(line), len(names)))
        whole[np.ix_(chain.coefficients, chain.parameters)] = jacobian
        line[drives], whole[drives] = rest, by_rest
        out.append((line, whole))
    return out


def _fields(model: Model, base: Base, states: Sequence[Array], scales: bool) -> tuple[tuple[str, ...], Array]:
    """Names of the generators, and what each does to the base (f, generators), lengths in sizes of the machine.

    states: coefficients (S,), one for each of `_states`.
    """
    fields = np.vstack([_fields_of(model, base, coefficients) for coefficients in states])
    independent = _independent_columns(fields)  # a base that is one point has no turn and no scale
    independent = [k for k in independent if k > 0 or scales]
    return tuple((_PLANAR if model.topology.planar else _SPATIAL)[k] for k in independent), fields[:, independent]


def _fields_of(model: Model, base: Base, coefficients: Array) -> Array:
    """What each generator does to the base (f, generators) with these coefficients (S,)."""
    places, length = base.positions(coefficients), model.length
    columns = [np.concatenate([(places / length).ravel(), np.zeros(3 * len(base.rotations))])]
    for k in [2] if model.topology.planar else range(3):
        axis = np.eye(3)[k]
        rotated = (skew(axis) @ places.T).T / length
        columns.append(np.concatenate([rotated.ravel(), np.tile(axis, len(base.rotations)) / length]))
    for k in range(2 if model.topology.planar else 3):
        columns.append(np.concatenate([np.tile(np.eye(3)[k], len(places)), np.zeros(3 * len(base.rotations))]))
    return np.stack(columns, axis=1)


def _independent_columns(fields: Array) -> list[int]:
    """Columns that say something of their own, shifts before turns before the scale."""
    chosen: list[int] = []
    for k in reversed(range(fields.shape[1])):
        if np.linalg.matrix_rank(fields[:, [*chosen, k]], tol=_SAME) > len(chosen):
            chosen.append(k)
    return sorted(chosen)


def _echelon(rows: Array) -> Array:
    """Reduced row echelon form with columns in order, so that each motion is named by its first generator."""
    rows, line = rows.copy(), 0
    for column in range(rows.shape[1]):
        if line >= len(rows):
            break
        best = line + int(np.argmax(np.abs(rows[line:, column])))
        if abs(rows[best, column]) < _SAME:
            continue
        rows[[line, best]] = rows[[best, line]]
        rows[line] /= rows[line, column]
        others = [k for k in range(len(rows)) if k != line]
        rows[others] -= np.outer(rows[others, column], rows[line])
        line += 1
    return rows


def _words(names: tuple[str, ...], row: Array) -> str:
    """A motion by its first generator."""
    return names[int(np.argmax(np.abs(row) > _SHARE * np.abs(row).max()))]


@dataclass(frozen=True)
class Datum:
    """Parameters that are held so that the base has a place: `held`, for the freedoms of `gauge`.

    missing: freedoms that no declared parameter fixes; proposed: parameters that would; of_held: what moves along.
    """

    gauge: Gauge
    held: tuple[str, ...]
    missing: int
    proposed: tuple[str, ...]
    of_held: HeldDatum | None = None

    @property
    def text(self) -> str:
        """What is not seen, and what fixes it."""
        message = f"the data do not fix the base ({', '.join(self.gauge.motions)})"
        return f"{message}; held fixed as datum: {', '.join(self.held)}" if self.held else message


def with_held(datum: Datum | None, held: tuple[str, ...]) -> Datum | None:
    """A datum of which some parameters are held already, so that the data need not show that they are free."""
    if not held:
        return datum
    if datum is None:
        return Datum(Gauge((), np.zeros((0, 0))), held, 0, held)
    return replace(datum, held=(*held, *datum.held), proposed=(*held, *datum.proposed))


def datum_of(problem: Problem, values: Array, directions: Directions) -> Datum | None:
    """The datum of a fit of some parameters at values (P,): of those declared, as many as are needed, in their order.

    None where nothing of the base is free.
    """
    gauge = gauge_of(problem, values, directions)
    if not gauge.motions:
        return None
    size = np.abs(gauge.directions).max(axis=0, initial=0.0)
    rows = {n: gauge.directions[:, k] for k, n in enumerate(directions.names) if size[k] > 1e-6 * size.max()}
    moved = {n: row * _in_lengths(problem.model, n, directions) for n, row in rows.items()}
    held = _independent([n for n in problem.model.datum if n in rows], moved)
    missing = len(gauge.motions) - len(held)
    several = {p.name for p in problem.model.parameters if p.session}  # which a file cannot name
    others = (n for n in rows if n not in held)
    ordered = sorted(others, key=lambda n: (n in several, -float(np.abs(rows[n]).max())))
    proposed = _independent([*held, *ordered], moved)
    return Datum(gauge, tuple(held), missing, tuple(proposed), _along(gauge, directions, held))


def _in_lengths(model: Model, name: str, directions: Directions) -> float:
    """What the range of a parameter moves, m, but for levers: of angles and slopes in sizes of the machine. Stiffnesses
    and weights move nothing."""
    levers = {"length": 1.0, "angle": model.length, "number": model.length}
    dimension = model.parameters[model.names.index(name)].dimension
    return float(directions.ranges[directions.names.index(name)]) * levers.get(dimension, 0.0)


def _along(gauge: Gauge, directions: Directions, held: list[str]) -> HeldDatum | None:
    """What moves along with each of the parameters that are held, none of the other held ones; None for none."""
    others = tuple(n for n in directions.names if n not in held)
    of_others, of_datum = ([directions.names.index(n) for n in some] for some in (others, held))
    if not held:
        return None
    moved = np.linalg.pinv(gauge.directions[:, of_datum]) @ gauge.directions[:, of_others]  # (g, p) in ranges
    moves = -moved.T * directions.ranges[of_others][:, None] / directions.ranges[of_datum]
    return HeldDatum(tuple(held), others, moves)


def _independent(names: Sequence[str], rows: dict[str, Array]) -> list[str]:
    """Names in their order whose rows are independent of those before: clearly, or at all where that is not enough.

    Two coordinates of one point are nearly dependent: held together they would fix its distance as well. So would the
    coordinate along its lever of a point that a rotation moves across it, which moves as little as it is off.
    """
    every = np.stack(list(rows.values())).astype(float)
    chosen: list[str] = []
    basis: list[NDArray[np.float64]] = []
    for least, share in ((_CLEARLY, _MUCH), (_HARDLY, _LITTLE)):
        for name in (n for n in names if n not in chosen):
            remainder = rows[name].astype(float)
            for known in basis:
                remainder = remainder - (known @ remainder) * known
            length = float(np.sqrt(remainder @ remainder))
            most = float(np.sqrt((every**2).sum(axis=1).max()))  # of what those before leave free
            if length > max(least * float(np.sqrt(rows[name] @ rows[name])), share * most):
                chosen.append(name)
                basis.append(remainder / length)
                every = every - np.outer(every @ basis[-1], basis[-1])
    return chosen
