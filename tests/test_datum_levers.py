"""A rotation of the base moves a point across its lever: the coordinate along it holds nothing, and is seen itself."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from tests.command import run

LEGS = """
units: {{length: mm, angle: deg}}
space: planar
ranges: {{length: 0.5}}
datum: [{datum}]
parameters: {{bx: 500, by: 0.2, o1: 300, o2: 350}}
ground: {{A: [0, 0], B: [bx, by]}}
nodes: {{tip: [250, 300]}}
bars: {{leg1: {{between: [A, tip]}}, leg2: {{between: [B, tip]}}}}
actuators: {{q1: {{drives: leg1, offset: o1}}, q2: {{drives: leg2, offset: o2}}}}
sensors: {{tracker: {{at: tip, reads: [x, y], sigma: 5 um, frame: fitted}}}}
"""
APART, O1, O2 = 500.3, 300.1, 349.8
"""Of the joints, and lengths of the legs at reading 0, mm: as built."""


def campaign(datum: str, folder: Path) -> None:
    """Where circles about the joints meet, seen by an instrument that stands anywhere."""
    rng = np.random.default_rng(3)
    q1, q2 = rng.uniform(0, 450, 40), rng.uniform(0, 400, 40)
    a, b = O1 + q1, O2 + q2
    x = (a**2 - b**2 + APART**2) / (2 * APART)
    tip = np.stack([x, np.sqrt(a**2 - x**2)])
    c, s = np.cos(0.7), np.sin(0.7)
    seen = np.array([[c, -s], [s, c]]) @ tip + np.array([[900.0], [-400.0]]) + rng.normal(0, 0.005, (2, 40))
    rows = [f"{i:.6f},{j:.6f},{u:.4f},{v:.4f}" for i, j, u, v in zip(q1, q2, *seen, strict=True)]
    (folder / "m.yaml").write_text(LEGS.format(datum=datum), encoding="utf-8")
    (folder / "t.csv").write_text("q1,q2,x,y\n" + "\n".join(rows) + "\n", encoding="utf-8")


def test_what_a_rotation_hardly_moves_does_not_hold_it(tmp_path: Path) -> None:
    """B is 500 mm from A along x and 0.2 mm across: a rotation moves bx by 1/2500 of by, and the table shows bx."""
    campaign("bx, by", tmp_path)
    done = run("calibrate", tmp_path / "m.yaml", tmp_path / "t.csv", "--holdout", "none", "--json")
    assert done.code == 0 and "held fixed as datum: by" in done.err
    found = {p["name"]: p for p in done.json["parameters"]}
    for name, true in (("bx", APART), ("o1", O1), ("o2", O2)):
        assert found[name]["value"] == pytest.approx(true, abs=4 * found[name]["std"]), name
        assert found[name]["std"] < 0.02


def test_a_datum_of_what_a_rotation_hardly_moves_is_too_short(tmp_path: Path) -> None:
    campaign("bx", tmp_path)
    done = run("calibrate", tmp_path / "m.yaml", tmp_path / "t.csv", "--holdout", "none")
    assert done.code == 3 and "`datum: [by]`" in done.err


def test_a_wide_range_is_no_small_motion(tmp_path: Path) -> None:
    """A joint that may be anywhere across its lever holds the rotation as well."""
    campaign("by", tmp_path)
    text = (tmp_path / "m.yaml").read_text(encoding="utf-8").replace("by: 0.2", "by: {nominal: 0.2, range: 5 m}")
    (tmp_path / "m.yaml").write_text(text, encoding="utf-8")
    done = run("calibrate", tmp_path / "m.yaml", tmp_path / "t.csv", "--holdout", "none")
    assert done.code == 0 and "held fixed as datum: by" in done.err
