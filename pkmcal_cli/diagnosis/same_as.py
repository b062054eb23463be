"""Effects that are another name for a parameter."""

from __future__ import annotations

import numpy as np

from pkmcal_cli.base.rotation import Array
from pkmcal_cli.diagnosis.hypotheses import RELEASE
from pkmcal_cli.diagnosis.scoring import Scored

_SAME = 0.99999  # cosine at which an effect is another name for a parameter


def same_as_parameters(first: Scored) -> dict[str, str]:
    """Names that are left out, and that under which the same is reported: of an effect whose signature is that of a
    parameter that is held, the parameter's.

    But the effect's where the parameter could not be seen within its range, and what is plausible of the effect could:
    a rod that is declared to 2 % may have a loose joint.
    """
    scores = {h: s for h, s in zip(first.hypotheses, first.scores, strict=True) if s.count == 1 == len(h.parameters)}
    direction = {h: _unit(first.linear.free(first.linear.of(h.parameters))[:, 0]) for h in scores}
    effects = [h for h in scores if h.effect != RELEASE]
    left_out: dict[str, str] = {}
    for release in sorted((h for h in scores if h.effect == RELEASE), key=lambda h: scores[h].far):
        same = [h for h in effects if abs(float(direction[h] @ direction[release])) > _SAME]
        plausible = [h for h in same if scores[release].far and not scores[h].far and h.name not in left_out]
        stands = (*plausible, release)[0]
        left_out |= {h.name: stands.name for h in (*same, release) if h != stands}
    return left_out


def _unit(column: Array) -> Array:
    return np.asarray(column / np.sqrt(column @ column))
