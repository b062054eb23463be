"""All stages, chunk by chunk."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace

import numpy as np

from pkmcal_cli.base.rotation import Array
from pkmcal_cli.equilibrium.kinematics import State
from pkmcal_cli.equilibrium.system import System
from pkmcal_cli.model.effect_sites import PlacedEffect
from pkmcal_cli.model.model import Model
from pkmcal_cli.prediction.effects import Displacements, displacements
from pkmcal_cli.prediction.inputs import Reactions
from pkmcal_cli.prediction.joined import join_rows
from pkmcal_cli.prediction.outcome import outcome
from pkmcal_cli.prediction.reactions import joined_reactions, reactions
from pkmcal_cli.prediction.rows import Prediction, Request, Rows
from pkmcal_cli.prediction.solving import solve
from pkmcal_cli.prediction.stages import BaseSlots, Chain, commanded_slots

_CHUNK_BYTES = 8e6  # of a chunk's largest arrays together, so that they stay in the processor's cache
_SMOOTHED = 0.1  # share of the usual force over which the sign of a force is smoothed
_LEAST_FORCE = 1e-3  # N
_FEWEST = 32  # rows of a chunk, or the calls cost more than the arithmetic


def predict(
    model: Model,
    values: Array,
    rows: Rows,
    request: Request | None = None,
    start: State | None = None,
    progress: Callable[[int], None] | None = None,
) -> Prediction:
    """Predicted readings of all rows at parameter values (P,), SI; `start`: states of an earlier prediction.

    Works in chunks, so memory is bounded but for the results. Rows that cannot be solved get a status, never numbers.
    Raises ValueError for derivatives of any method but `exact`: they hold at equilibrium only.
    """
    request = request or Request()
    if request.method != "exact" and (request.parameters is not None or request.by_drive):
        raise ValueError(f"derivatives are those of the equilibrium: no derivatives with method {request.method}")
    base = BaseSlots.of(model, values)
    chain = Chain.of(model, values, request)
    moved = _moved(model, values, base, rows, request, chain)
    parts = []
    for chunk in row_chunks(model.exact, len(rows)):
        some, mine, begin = rows.take(chunk), moved.take(chunk), None if start is None else start.take(chunk)
        slots = commanded_slots(model, base, some)
        mine.apply(slots)
        solution = solve(model, slots, request.method, begin)
        parts.append(outcome(model, solution, some, request, chain, mine))
        if progress is not None:
            progress(chunk.stop - chunk.start)
    found = _joined(parts)
    alone = np.full(len(rows), -1)
    return join_rows(model, found, alone if rows.partner is None else rows.partner)


def _moved(model: Model, values: Array, base: BaseSlots, rows: Rows, request: Request, chain: Chain) -> Displacements:
    """What effects displace in every row of the table; reactive ones by the forces of a pass without them."""
    asked = request.parameters or ()
    numbers = model.by_name(values)
    acting = {e.name for e in model.effects if any(numbers[n] for n in e.parameters)}
    wanted = acting | {e.name for e in model.effects if any(n in asked for n in e.parameters)}
    reactive = [e for e in model.effects if e.effect.reactive and e.name in wanted]
    if not reactive:
        return displacements(model, values, rows, asked, None)
    known = chain if request.derivatives and acting & {e.name for e in reactive} else None
    first = displacements(model, values, rows, asked, None)
    found = _earlier_pass(model, base, rows, reactive, known, first)
    return displacements(model, values, rows, asked, found)


def _earlier_pass(
    model: Model,
    base: BaseSlots,
    rows: Rows,
    reactive: Sequence[PlacedEffect],
    chain: Chain | None,
    moved: Displacements,
) -> Reactions:
    """Forces at the sockets of reactive effects, while these do not act."""
    parts = []
    for chunk in row_chunks(model.exact, len(rows)):
        some, mine = rows.take(chunk), moved.take(chunk)
        slots = commanded_slots(model, base, some)
        mine.apply(slots)
        parts.append(reactions(model, solve(model, slots, "exact", None), reactive, some, chain, mine))
    return joined_reactions(parts)


def settled_smoothing(model: Model, values: Array, rows: Rows) -> Model:
    """The model with the force over which signs are smoothed stated for every reactive effect that leaves it open.

    A tenth of the root mean square force at its place, at parameter values (P,).
    """
    some = [e for e in model.effects if e.effect.reactive and "smooth" not in e.options and _smooths(e)]
    if not some:
        return model
    base = BaseSlots.of(model, values)
    found = _earlier_pass(model, base, rows, some, None, displacements(model, values, rows, (), None))
    size = dict(zip(found.places, np.sqrt(np.nanmean(found.values**2, axis=0)), strict=True))
    settled = {e.name: max(_SMOOTHED * max(float(size[s.place]) for s in e.sockets), _LEAST_FORCE) for e in some}
    effects = tuple(
        replace(e, options={**e.options, "smooth": (settled[e.name],)}) if e.name in settled else e
        for e in model.effects
    )
    return model.with_options(effects)


def _smooths(placed: PlacedEffect) -> bool:
    return any(option.name == "smooth" for option in placed.effect.options)


def row_chunks(system: System, rows: int) -> Iterator[slice]:
    """Rows that are worked on together."""
    maps = system.maps
    entries = system.size**2 + maps.tangent.columns + system.view_maps.views.height + len(system.layout.slots.constants)
    size = max(_FEWEST, int(_CHUNK_BYTES / (8 * entries)))
    for first in range(0, max(rows, 1), size):
        yield slice(first, min(first + size, rows))


def _joined(parts: Sequence[Prediction]) -> Prediction:
    """Predictions of consecutive chunks as one."""

    def join(name: str) -> Array | None:
        pieces = [getattr(part, name) for part in parts]
        return None if pieces[0] is None else np.concatenate(pieces)

    if len(parts) == 1:
        return parts[0]
    names = ("travel", "rotation", "multiplier")
    state = State(*(np.concatenate([getattr(part.state, name) for part in parts]) for name in names))
    slack, first = {}, 0
    for part in parts:
        slack.update({first + row: name for row, name in part.slack.items()})
        first += len(part.status)
    return Prediction(
        values=np.concatenate([part.values for part in parts]),
        status=np.concatenate([part.status for part in parts]),
        state=state,
        jacobian=join("jacobian"),
        by_drive=join("by_drive"),
        forces=join("forces"),
        energy=join("energy"),
        slack=slack,
        steps=sum(part.steps for part in parts),
    )
