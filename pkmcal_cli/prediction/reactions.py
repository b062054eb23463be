"""Forces of a pass, for effects that depend on them in the next one: two fixed passes, no iteration."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from pkmcal_cli.equilibrium.assembly import balance, group_view
from pkmcal_cli.equilibrium.kinematics import arm_vectors, views
from pkmcal_cli.model import Model
from pkmcal_cli.prediction.inputs import Reactions
from pkmcal_cli.prediction.outcome import drive_forces
from pkmcal_cli.prediction.solving import Solution
from pkmcal_cli.sockets import PlacedEffect


def reactions(model: Model, solution: Solution, effects: Sequence[PlacedEffect]) -> Reactions:
    """Drive forces, and pulls and chords of the members that the effects sit at; nan in rows that failed."""
    members = {s.member for e in effects for s in e.sockets if s.member[0] >= 0}
    forces = drive_forces(model, solution)[0]
    system, state = solution.system, solution.state
    found = balance(system, solution.numbers, state, 1.0, tangent=False, slack=solution.slack)
    stacked = views(system, state, arm_vectors(model.layout, solution.slots, state))
    pulls, chords = {}, {}
    for g, e in sorted(members):
        chord = group_view(system, g, stacked).delta[:, e]
        pulls[g, e] = np.asarray(found.stresses[g][:, e, 0])
        chords[g, e] = chord / np.sqrt((chord**2).sum(axis=1, keepdims=True))
    return Reactions(forces, pulls, chords)


def joined_reactions(parts: Sequence[Reactions]) -> Reactions:
    """Reactions of consecutive chunks."""
    return Reactions(
        np.concatenate([p.drives for p in parts]),
        {m: np.concatenate([p.pulls[m] for p in parts]) for m in parts[0].pulls},
        {m: np.concatenate([p.chords[m] for p in parts]) for m in parts[0].chords},
    )
