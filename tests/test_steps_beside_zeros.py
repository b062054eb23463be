"""Drives with a wrong sign, unit or other steps, where nobody knows from which zero they count."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from pkmcal_cli.base.rotation import Array
from pkmcal_cli.gross_errors.drive_zeros import explain_steps
from tests.command import clean, run

pytestmark = pytest.mark.usefixtures("unsized")

L1, L2 = 300.0, 320.0
ZEROS = 120.0, -80.0  # mm: stated as 0, to within 300 mm
MACHINE = f"""
units: {{length: mm}}
space: planar
ranges: {{length: 0.1}}
parameters: {{l1: {L1}, l2: {L2}, z1: {{nominal: 0, range: 300}}, z2: {{nominal: 0, range: 300}}}}
guides: {{rail: {{along: x}}}}
bodies: {{c1: {{guide: rail, at: -180}}, c2: {{guide: rail, at: 211.66010488516726}}}}
nodes: {{tcp: [0, 240]}}
bars: {{rod1: {{between: [c1, tcp], length: l1}}, rod2: {{between: [c2, tcp], length: l2}}}}
actuators: {{q1: {{moves: c1, zero: z1}}, q2: {{moves: c2, zero: z2}}}}
sensors: {{tracker: {{at: tcp, reads: [x, y], sigma: 10 um, frame: machine}}}}
"""


def table(folder: Path, change: Callable[[Array], Array]) -> tuple[Path, Path]:
    """The machine, and 24 poses of which the first drive's readings are changed: two circles that meet in the tool."""
    rng = np.random.default_rng(3)
    x, y = rng.uniform(-150, 150, 24), rng.uniform(150, 270, 24)
    q1, q2 = x - np.sqrt(L1**2 - y**2) - ZEROS[0], x + np.sqrt(L2**2 - y**2) - ZEROS[1]
    read = np.stack([change(q1), q2, *(c + rng.normal(0, 0.01, 24) for c in (x, y))], axis=1)
    (machine := folder / "m.yaml").write_text(MACHINE, encoding="utf-8")
    lines = ["q1 [mm],q2 [mm],x [mm],y [mm]", *(",".join(f"{v:.6f}" for v in row) for row in read), ""]
    (measured := folder / "t.csv").write_text("\n".join(lines), encoding="utf-8")
    return machine, measured


WRONG = {
    "sign": (lambda q: -q, "`q1` looks reversed in sign"),
    "inch": (lambda q: q / 25.4, "`q1` looks 25.4 times too small (is it in `in`, not `mm`?), counted from another"),
    "twice": (lambda q: 2.0 * q, "`q1` reads 2 times what it should at the measured poses (are its steps right?)"),
    "counts": (lambda q: 137.0 * q + 5000.0, "`q1` reads 137 times what it should at the measured poses"),
    "counts down": (lambda q: 9e4 - 137.0 * q, "`q1` reads 137 times what it should"),
}


@pytest.mark.parametrize("mistake", WRONG)
def test_steps_are_told_beside_unknown_zeros(mistake: str, tmp_path: Path) -> None:
    """`check` was silent: the ranges of the zeros are as large as what a wrong unit does."""
    change, words = WRONG[mistake]
    done = clean(run("check", *table(tmp_path, change)))
    assert done.code == 1 and words in done.err, done.err
    assert not any("`q2`" in line and "its steps" in line for line in done.err.splitlines()), done.err


def test_other_zeros_are_no_mistake(tmp_path: Path) -> None:
    """Also where they are further off than any range, as a fit will say."""
    for shift in (0.0, 250.0):
        done = clean(run("check", *table(tmp_path, lambda q, by=shift: q + by)))
        assert "times" not in done.err and "reversed" not in done.err, done.err


def test_the_search_goes_on_with_the_table_put_right(tmp_path: Path) -> None:
    """A column in inches took the search minutes, to no name; all that is left is noise."""
    done = run("diagnose", *table(tmp_path, WRONG["inch"][0]), "--json")
    assert done.json["verdict"] == "measurement_fault" and done.json["effects"] == []


@pytest.mark.parametrize(("factor", "hints"), [(1.0, 0), (1.01, 0), (1.1, 0), (2.0, 1), (-1.0, 1)])
def test_a_scale_that_a_search_may_find_is_left_to_it(factor: float, hints: int) -> None:
    """Steps 1 or 10 % off beside an unknown zero are an effect with an uncertainty; twice as large ones are a slip."""
    should = np.random.default_rng(1).uniform(0.0, 0.4, size=(12, 1))
    assert len(explain_steps(factor * should + 0.7, should, ["q1"], ["mm"])) == hints
