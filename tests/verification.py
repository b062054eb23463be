"""The table of what is shown: `python -m tests.verification > docs/verification.md`.

Every row is (name, required, measured); tests assert the same numbers.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from pkmcal_cli.prediction import Request
from pkmcal_cli.rotation import exp
from tests import structures
from tests.measured import (
    REDUNDANT,
    against_force_control,
    against_hangprinter,
    against_truth,
    elastica_error,
    hangprinter,
    jacobian_check,
    readings_of,
    spread_over_substructures,
    strained_values,
)
from tests.support import SHIPPED, displacement
from tests.truth.machines import PINNED


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


def bending() -> list[Row]:
    """Cantilever at P L^2 / EI = 5, in the plane and turned in space, and the order of its error."""
    rows = []
    for place, turn in (("in the plane", None), ("turned in space", exp(np.array([0.5, -1.0, 0.7])))):
        coarse, fine = (elastica_error(n, turn) for n in (16, 32))
        text = f"cantilever {place}, P L^2/EI = 5, against the elastica"
        rows.append(Row(f"{text}: 32 elements, relative", "< 1e-3", fine))
        rows.append(Row(f"{text}: error of 16 over that of 32 elements", "4 (h^2)", coarse / fine))
    return rows


def energy() -> list[Row]:
    """Position-controlled machines against their energy."""
    rows = []
    for name in PINNED:
        found = against_truth(name)
        text = f"{name}, errors up to 1 mm and a load, against its least energy"
        rows += [
            Row(f"{text}: `exact`, um", "< 1e-5", found.position),
            Row(f"{text}: `linear` beside it, um", "shown", found.linear),
        ]
    bent = against_truth("hexapod7", 1e-4)
    text = "hexapod7, errors up to 0.1 mm and a load, against chains of rigid pieces"
    rows.append(Row(f"{text}: `exact`, um", "< 1e-5", bent.position))
    rows.append(Row(f"{text}: `linear` beside it, um", "shown", bent.linear))
    return rows


def substructures() -> list[Row]:
    """`exact` for every choice of redundant drives."""
    rows = []
    for name in REDUNDANT:
        spread, choices = spread_over_substructures(name)
        rows.append(Row(f"{name}: `exact` over {choices} choices of redundant drives, mm", "< 1e-8", spread))
    return rows


def force_control() -> list[Row]:
    """Redundant drives under force control: their predicted positions."""
    rows = []
    for name in REDUNDANT:
        tcp, _, travel, moved = against_force_control(name)
        text = f"{name}, redundant drives in force control"
        rows.append(Row(f"{text}: drive positions (they move by {moved:.0f} um), um", "< 1e-5", travel))
        rows.append(Row(f"{text}: TCP, um", "< 1e-5", tcp))
    line = against_hangprinter()
    text = "hangprinter, upper line in force control"
    rows.append(Row(f"{text}: its length, um", "< 1e-5", line.line))
    rows.append(Row(f"{text}: TCP, um", "< 1e-5", line.tcp))
    return rows


def jacobian() -> list[Row]:
    """Every parameter and drive of every shipped machine, off its nominal values."""
    rows = []
    for name in SHIPPED:
        text = hangprinter(40.0) if name == "hangprinter" else name
        found = jacobian_check(text, readings_of(name), strained_values(text))
        of = f"{name}: {found.columns} columns of the Jacobian at strained poses"
        rows.append(Row(f"{of}, deviation from differences by the column's largest entry", "< 1e-6", found.deviation))
        if found.null:
            rows.append(Row(f"{of}, null columns ({', '.join(found.null)}), um per range", "< 1e-9", found.null_size))
    return rows
