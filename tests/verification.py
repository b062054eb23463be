"""The table of what is shown: `python -m tests.verification > docs/verification.md`.

Every row is (name, required, measured); tests assert the same numbers.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from pkmcal_cli.prediction import Request
from tests import structures
from tests.support import displacement


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
