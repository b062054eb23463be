"""Effects that are another name for a parameter."""

from __future__ import annotations

import numpy as np

from pkmcal_cli.diagnosis.hypotheses import RELEASE
from pkmcal_cli.diagnosis.scoring import Scored

_SAME = 0.99999  # cosine at which an effect is another name for a parameter


def same_as_parameters(first: Scored) -> dict[str, str]:
    """Effects whose signature is that of a parameter that is held, by name; they are reported under the parameter."""
    free = {}
    for h, s in zip(first.hypotheses, first.scores, strict=True):
        if s.count == 1 and len(h.parameters) == 1:
            column = first.linear.free(first.linear.of(h.parameters))[:, 0]
            free[h.name] = (h, column / np.sqrt(column @ column))
    releases = [(name, column) for name, (h, column) in free.items() if h.effect == RELEASE]
    return {
        name: other
        for name, (h, column) in free.items()
        if h.effect != RELEASE
        for other, of_release in releases
        if abs(float(column @ of_release)) > _SAME
    }
