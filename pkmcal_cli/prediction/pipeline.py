"""All stages run chunk by chunk: chunks bound the memory, and a chunk starts from the solution of an earlier call.

z = h(u(c(p, q, theta)), c): parameters p, readings q of drives and effects theta give coefficients c, `equilibrium` the
solution u with g(u, c) = 0, and `outcome` its readings z; the derivatives follow by the chain rule.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from pkmcal_cli.base.lean import lean_join
from pkmcal_cli.base.rotation import Array
from pkmcal_cli.equilibrium.kinematics import State
from pkmcal_cli.equilibrium.system import System
from pkmcal_cli.model.effect_sites import PlacedEffect
from pkmcal_cli.model.model import Model
from pkmcal_cli.prediction.displacements import Displacements, displacements
from pkmcal_cli.prediction.inputs import Reactions
from pkmcal_cli.prediction.joined import join_rows
from pkmcal_cli.prediction.outcome import outcome
from pkmcal_cli.prediction.reactions import joined_reactions, reactions
from pkmcal_cli.prediction.rope_strains import joined_rope_strains
from pkmcal_cli.prediction.rows import Method, Prediction, Request, RowLost, Rows, WarmStart
from pkmcal_cli.prediction.solving import Solution, solve
from pkmcal_cli.prediction.stages import BaseCoefficients, Chain, commanded_coefficients

Receiver = Callable[[slice, Prediction], None]

_CHUNK_BYTES = 8e6  # of a chunk's largest arrays together, so that they stay in the processor's cache
_SMOOTHED = 0.1  # share of the usual force over which the sign of a force is smoothed
_LEAST_FORCE = 1e-3  # N
_STATE = ("translation", "rotation", "multiplier")
_LEAN = ("status", "misfit")  # often the same in all rows
_FULL = ("values", "jacobian", "by_drive", "forces", "energy", "tension")
_FEWEST = 32  # rows of a chunk, or the calls cost more than the arithmetic


def predict(
    model: Model,
    values: Array,
    rows: Rows,
    request: Request | None = None,
    start: WarmStart | None = None,
    progress: Callable[[int], None] | None = None,
    receive: Receiver | None = None,
) -> Prediction:
    """Predict the readings of all rows at parameter values (P,), SI; `start`: from an earlier prediction.

    Works in chunks, so memory is bounded but for the results. Rows that cannot be solved get a status, never numbers.
    `receive` takes the derivatives of each chunk, which are then not kept; not with measurements that join rows.
    Raises ValueError for derivatives of any method but `exact`: they hold at equilibrium only; RowLost where the
    request is sparing.
    """
    request = request or Request()
    if request.method != "exact" and (request.parameters is not None or request.by_drive):
        raise ValueError(f"method {request.method} has no derivatives; only the equilibrium has")
    base = BaseCoefficients.of(model, values, rows)
    chain = Chain.of(model, values, request, rows)
    moved = _moved(model, values, base, rows, request, chain=chain, start=start)
    parts = []
    for chunk in row_chunks(model.exact, len(rows)):
        some, part_moved, begin = rows.take(chunk), moved.take(chunk), None if start is None else start.take(chunk)
        coefficients = commanded_coefficients(model, base, some)
        part_moved.apply(coefficients)
        solution = _solved(model, coefficients, begin, some, request)
        part = outcome(model, solution, some, request, chain, part_moved)
        if receive is not None:
            receive(chunk, part)
            part = replace(part, jacobian=None, by_drive=None)
        parts.append(part)
        if progress is not None:
            progress(chunk.stop - chunk.start)
    prediction = _joined(parts)
    alone = np.full(len(rows), -1)
    return join_rows(model, prediction, alone if rows.partner is None else rows.partner)


def _solved(model: Model, coefficients: Array, start: WarmStart | None, rows: Rows, request: Request) -> Solution:
    """States of some rows. Raises RowLost where one that was measured has none and the request is sparing."""
    if not request.sparing or rows.measured is None:
        return solve(model, coefficients, request.method, start, request.compare)
    measured = np.isfinite(rows.measured).any(axis=1)
    solution = solve(model, coefficients, request.method, start, request.compare, sparing=bool(measured.all()))
    if (solution.failed & measured).any():
        raise RowLost
    return solution


def configuration(model: Model, values: Array, rows: Rows, row: int, method: Method = "exact") -> Solution:
    """Solve the state of one row at parameter values (P,), SI; effects see the whole table."""
    base, request = BaseCoefficients.of(model, values, rows), Request(method=method)
    moved = _moved(model, values, base, rows, request, chain=Chain.of(model, values, request, rows), start=None)
    only = slice(row, row + 1)
    coefficients = commanded_coefficients(model, base, rows.take(only))
    moved.take(only).apply(coefficients)
    return solve(model, coefficients, method, None, True)


def _moved(
    model: Model,
    values: Array,
    base: BaseCoefficients,
    rows: Rows,
    request: Request,
    chain: Chain,
    start: WarmStart | None,
) -> Displacements:
    """What effects displace in every row of the table; reactive ones by the forces of a pass without them."""
    asked = request.parameters or ()
    first = displacements(model, values, rows, asked, None)
    numbers, named = model.by_name(values), frozenset(asked)
    able = [(e, any(numbers[n] for n in e.parameters)) for e in model.effects if e.effect.reactive]
    reactive = [e for e, acts in able if acts or not named.isdisjoint(e.parameters)]
    if not reactive:
        return first
    known = chain if request.derivatives and any(acts for _, acts in able) else None
    earlier = _earlier_pass(model, base, rows, reactive, known, first, start=start)
    return displacements(model, values, rows, asked, earlier, first)


def _earlier_pass(
    model: Model,
    base: BaseCoefficients,
    rows: Rows,
    reactive: Sequence[PlacedEffect],
    chain: Chain | None,
    moved: Displacements,
    start: WarmStart | None = None,
) -> Reactions:
    """Forces at the effect sites of reactive effects, while these do not act; `start`: states near the solution."""
    parts = []
    for chunk in row_chunks(model.exact, len(rows)):
        some, part_moved = rows.take(chunk), moved.take(chunk)
        coefficients = commanded_coefficients(model, base, some)
        part_moved.apply(coefficients)
        begin = None if start is None else start.take(chunk)
        parts.append(
            reactions(model, solve(model, coefficients, "exact", begin, True), reactive, some, chain, part_moved)
        )
    return joined_reactions(parts)


def fixed_smoothing(model: Model, values: Array, rows: Rows, start: WarmStart | None = None) -> Model:
    """State the force over which signs are smoothed for every reactive effect of a model that leaves it open.

    A tenth of the root mean square force at its place, at parameter values (P,); `start`: states near those there.
    """
    some = [e for e in model.effects if e.effect.reactive and "smooth" not in e.options and _smooths(e)]
    if not some:
        return model
    base = BaseCoefficients.of(model, values, rows)
    earlier = _earlier_pass(model, base, rows, some, None, displacements(model, values, rows, (), None), start=start)
    size = dict(zip(earlier.places, np.sqrt(np.nanmean(earlier.values**2, axis=0)), strict=True))
    fixed = {e.name: max(_SMOOTHED * max(float(size[s.place]) for s in e.sites), _LEAST_FORCE) for e in some}
    effects = tuple(
        replace(e, options={**e.options, "smooth": (fixed[e.name],)}) if e.name in fixed else e for e in model.effects
    )
    return model.with_options(effects)


def _smooths(placed: PlacedEffect) -> bool:
    return any(option.name == "smooth" for option in placed.effect.options)


def row_chunks(system: System, rows: int) -> Iterator[slice]:
    """Divide rows into chunks that are worked on together, of one length but for a row: each call has a price."""
    maps = system.maps
    entries = (
        maps.width
        + maps.tangent.columns
        + system.geometry_maps.geometries.height
        + len(system.topology.coefficients.constants)
    )
    size = max(_FEWEST, int(_CHUNK_BYTES / (8 * entries)))
    chunks = max(-(-rows // size), 1)
    for k in range(chunks):
        yield slice(k * rows // chunks, (k + 1) * rows // chunks)


def _joined(parts: list[Prediction]) -> Prediction:
    """Predictions of consecutive chunks as one; empties the list, so that memory holds rows hardly more than once."""
    if len(parts) == 1:
        return parts.pop()
    starts = np.cumsum([0, *(len(p.status) for p in parts)]).tolist()
    slack = {start + row: names for start, p in zip(starts, parts, strict=False) for row, names in p.slack.items()}
    ropes = None if parts[0].ropes is None else joined_rope_strains([p.ropes for p in parts if p.ropes is not None])
    asked = [p.sought for p in parts if p.sought is not None]
    whole = len(asked) == len(parts)
    sought = replace(asked[0], marks=np.concatenate([a.marks for a in asked])) if whole else None
    first = replace(parts[0], slack=slack, steps=sum(p.steps for p in parts), ropes=ropes, sought=sought)
    columns = {name: [getattr(p, name) for p in parts] for name in (*_LEAN, *_FULL)}
    states = {name: [getattr(p.state, name) for p in parts] for name in _STATE}
    parts.clear()
    state = State(*(lean_join(states.pop(name)) for name in _STATE))
    joined: dict[str, Any] = {name: lean_join(columns.pop(name)) for name in _LEAN}
    joined |= {name: np.concatenate(columns.pop(name)) for name in _FULL if columns[name][0] is not None}
    return replace(first, state=state, **joined)
