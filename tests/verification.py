"""The table of what is shown: `python -m tests.verification > docs/verification.md`.

Every row is (name, required, measured); tests assert the same numbers.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from pkmcal_cli.prediction import Request
from pkmcal_cli.rotation import Array
from tests import structures
from tests.support import displacement
from tests.truth.test_truth_bending import elastica


class Row(NamedTuple):
    """One line of the table: what is shown, what it must be, the measured number."""

    name: str
    required: str
    measured: float


def frames() -> list[Row]:
    """Displacement of T in the frames of other programs, largest relative deviation."""
    rows = []
    for name, text in (
        ("planar_three_rods", structures.PLANAR_FRAME),
        ("spatial_gough_stewart", structures.spatial_frame()),
    ):
        given = np.array(structures.REFERENCE[name]["displacement_of_T"])
        found = displacement(text, Request(method="linear"))
        unit = np.where(np.arange(len(given)) < 3, 1e-3, 1.0)
        rows.append(Row(f"frame `{name}`, `linear`", "< 1e-9 relative", float(np.abs(found / unit / given - 1).max())))
    return rows


def elastica_error(pieces: int, turn: Array | None = None) -> float:
    """Distance of the tip from the elastica's at P L^2 / EI = 5, relative to its travel across."""
    back, over = elastica(5.0)
    found = displacement(structures.cantilever(pieces, (0, 5, 0), turn))
    tip = found[:2] if turn is None else (turn.T @ found[:3])[:2]
    return float(np.hypot(tip[0] + back, tip[1] - over) / over)
