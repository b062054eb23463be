"""The table of what is shown: `python -m tests.verification > docs/verification.md`, ten minutes.

With names of parts, such as `many_poses`, only their lines.
"""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterable
from itertools import chain

import numpy as np

from pkmcal_cli.base.rotation import exp
from pkmcal_cli.prediction import Request
from tests import paper, structures, verification_calibration
from tests.measured import (
    REDUNDANT,
    against_force_control,
    against_frame,
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
from tests.verification_poses import many_poses, poses
from tests.verification_ropes import ropes
from tests.verification_row import Row


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
        rows.append(Row(f"frame `{name}`, `linear`, relative", "< 1e-9", float(np.abs(found / unit / given - 1).max())))
    return rows


def bending() -> list[Row]:
    """Cantilever at P L^2 / EI = 5, in the plane and turned in space, and the order of its error."""
    rows = []
    for place, turn in (("in the plane", None), ("turned in space", exp(np.array([0.5, -1.0, 0.7])))):
        coarse, fine = (elastica_error(n, turn) for n in (16, 32))
        text = f"cantilever {place}, P L^2/EI = 5, against the elastica"
        rows.append(Row(f"{text}: 32 elements, relative", "< 1e-3", fine))
        rows.append(Row(f"{text}: error with 16 elements over error with 32 (order h^2)", "4 (1 %)", coarse / fine))
    return rows


def energy() -> list[Row]:
    """Position-controlled machines against their energy."""
    rows = []
    for name in PINNED:
        found = against_truth(name)
        text = f"{name}, errors up to 1 mm and a load, against its energy minimum"
        rows += [
            Row(f"{text}: `exact`, um", "< 1e-5", found.position),
            Row(f"{text}: `linear` for comparison, um", "shown", found.linear),
        ]
    bent = against_truth("hexapod7", 1e-4)
    text = "hexapod7, errors up to 0.1 mm and a load, against chains of rigid pieces"
    rows.append(Row(f"{text}: `exact`, um", "< 1e-5", bent.position))
    rows.append(Row(f"{text}: `linear` for comparison, um", "shown", bent.linear))
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


def gantry() -> list[Row]:
    """A beam on which a carriage runs."""
    found, deflection = against_frame(0, errors=True)
    text = "gantry, drives out of step, all parameters off, against frames of fine beam elements"
    return [
        Row(f"{text}: `exact` over the deflection by weight ({deflection:.0f} um)", "< 1e-6", found),
        Row(f"{text}: one element a span for comparison", "shown", against_frame(0, errors=True, pieces=1)[0]),
    ]


def jacobian() -> list[Row]:
    """Every parameter and drive of every shipped machine, off its nominal values."""
    rows = []
    for name in SHIPPED:
        text = hangprinter(40.0) if name == "hangprinter" else name
        found = jacobian_check(text, readings_of(name), strained_values(text))
        of = f"{name}: {found.columns} columns of the Jacobian at strained poses"
        rows.append(Row(f"{of}, deviation from finite differences over largest entry", "< 1e-6", found.deviation))
        if found.null:
            rows.append(Row(f"{of}, null columns ({', '.join(found.null)}), um per range", "< 1e-9", found.null_size))
    return rows


def paper_triglide() -> list[Row]:
    """Numbers of the paper's Triglide."""
    without, with_gamma = paper.triglide_conditions()
    ratios = paper.triglide_ratios()
    of = "Triglide non-redundant, 3 x 77 grid, condition number of Js"
    rows = [Row(f"{of} without gamma", "60.06", without), Row(f"{of} with gamma", "3139", with_gamma)]
    of = "Triglide, sensitivity non-redundant over redundant"
    rows += [Row(f"{of}: {name}", f"{paper.RATIOS[name]:.2f}", ratio) for name, ratio in ratios.items()]
    rows.append(Row(f"{of}: mean", "1.27", float(np.mean(list(ratios.values())))))
    of = "Triglide, influence of k1 to k3, um per 1000 N/mm"
    still, strained = paper.triglide_stiffness(0.0), paper.triglide_stiffness(50e-6)
    return [
        *rows,
        Row(f"{of}: nominal geometry, no load, largest", "< 1e-9", max(still.values())),
        Row(f"{of}: q3 + 50 um, smallest of the three", "> 0.1", min(strained.values())),
        Row("Triglide, 1 deg of gamma at x = 300 mm, y = 275 mm, mm", "7.1", paper.triglide_gamma()),
    ]


def paper_scissors() -> list[Row]:
    """Numbers of the paper's Scissors Kinematics."""
    shifts = {name: abs(found[0]) for name, found in paper.scissors_shifts().items() if not name.startswith("g")}
    guides = shifts.pop("d1"), shifts.pop("d2")
    elastic, rigid = paper.scissors_deviations()
    soft = paper.scissors_stiffness()
    of, by = "Scissors, like figure 17 (30 um)", "Scissors, like figure 18 (q1 - 50 um, q4 + 50 um; 10 kN/mm)"
    return [
        Row("Scissors, nine parameters, 80 points, condition number of Js", "282 (1 %)", paper.scissors_condition()),
        Row(f"{of}: mean x-shift of rods and joints, smallest ({min(shifts, key=shifts.__getitem__)}), um", "2 to 13",
            min(shifts.values())),
        Row(f"{of}: mean x-shift of rods and joints, largest ({max(shifts, key=shifts.__getitem__)}), um", "2 to 13",
            max(shifts.values())),
        Row(f"{of}: mean x-shift of d1, um", "13 to 17", guides[0]),
        Row(f"{of}: mean x-shift of d2, um", "13 to 17", guides[1]),
        Row(f"{of}: d1 and d2 together, which shift the whole machine, um", "30 (0.01 %)", sum(guides)),
        Row(f"{of}: mean deviation of the elastic model from the energy minimum, %", "< 1e-4", 100 * elastic),
        Row(f"{of}: mean deviation of the rigid model from the energy minimum, %", "> 100", 100 * rigid),
        Row(f"{by}: smallest of the five shifts, um", "0.001 to 0.3", min(soft.values())),
        Row(f"{by}: largest of the five shifts, um", "0.001 to 0.3", max(soft.values())),
    ]  # fmt: skip


PARTS: list[Callable[[], list[Row]]] = [
    frames,
    bending,
    energy,
    substructures,
    poses,
    many_poses,
    force_control,
    gantry,
    jacobian,
    ropes,
    paper_triglide,
    paper_scissors,
    *verification_calibration.PARTS,
]
"""Parts of the table in order."""

HEAD = """# Verification

Written by `python -m tests.verification > docs/verification.md`. The tests assert the same numbers, and that those
below meet their bounds. A single number must be met to the digits given; a tolerance follows in brackets or after
`+-`. `shown` marks a number given for comparison with the one before it, without a bound of its own.

| quantity | required | measured |
|---|---|---|
"""


def table(parts: Iterable[Callable[[], list[Row]]]) -> str:
    """The table in Markdown."""
    return HEAD + "".join(f"{row.line}\n" for row in chain.from_iterable(part() for part in parts))


if __name__ == "__main__":
    CHOSEN = [part for part in PARTS if part.__name__ in sys.argv[1:]]
    sys.stdout.write("".join(f"{row.line}\n" for part in CHOSEN for row in part()) if CHOSEN else table(PARTS))
