"""An error that comes again along a drive without a stated period: the remedy that is told names it when followed."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from tests.command import run

SLIDE = """
units: {length: mm, angle: deg}
space: planar
ranges: {length: 0.5}
parameters: {z: {nominal: 0, note: zero of the drive}, h: {nominal: 40, note: height of the mark}}
guides: {rail: {along: x}}
bodies: {car: {guide: rail, at: 200, points: {mark: [0, h]}}}
actuators: {q: {moves: car, zero: zDRIVE}}
sensors: {tracker: {at: mark, reads: [x, y], sigma: 2 um, frame: machine}}
"""


def test_the_remedy_for_an_oscillation_along_a_drive_names_it(tmp_path: Path) -> None:
    """8 um of a screw with a lead of 20 mm, over 400 mm: x = q + 8 um sin(2 pi q / 20 mm)."""
    machine, table = tmp_path / "m.yaml", tmp_path / "t.csv"
    rng = np.random.default_rng(4)
    q = np.round(np.append(rng.uniform(0, 400, size=78), [0, 400]), 3)
    x = q + 0.12 + 8e-3 * np.sin(2 * np.pi * q / 20 + 0.4) + 2e-3 * rng.normal(size=80)
    y = 40.05 + 2e-3 * rng.normal(size=80)
    rows = "\n".join(f"{a:.3f},{b:.4f},{c:.4f}" for a, b, c in zip(q, x, y, strict=True))
    table.write_text(f"q [mm],x [mm],y [mm]\n{rows}\n", encoding="utf-8")
    machine.write_text(SLIDE.replace("DRIVE", ""), encoding="utf-8")
    told = run("diagnose", machine, table).err
    assert "oscillation along q, 20 periods over its range" in told
    assert "`actuators: {q: {period: ...}}`" in told
    machine.write_text(SLIDE.replace("DRIVE", ", period: 20 mm"), encoding="utf-8")
    (found,) = run("diagnose", machine, table, "--json").json["effects"]
    assert (found["effect"], found["at"]) == ("pitch", "q")
