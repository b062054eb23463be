"""`pkmcal new KIND`: what the head of a file says can be arranged otherwise, as overlays."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.command import run

X_RAILS = """
frames: {left: {turn: [bl, al, cl]}, right: {at: [0, 1000, zr], turn: [0, ar, cl + cr]}}
guides: {rail1: {along: [1, sq, 0]}, rail2: {along: [1, sq, 0], stiffness: {x: null, y: kx}}}
workspace: {box: {x: [0, 900], y: [100, 900], z: [10, 190]}}
"""
NO_RAM = """
parameters: {z0: null, sz: null, sqx: null, sqy: null}
frames: {quill: null}
guides: {ram: null}
bodies: {quill: null, carriage: {points: {nose: [0, -80, -100]}}}
actuators: {Z: null}
workspace: {box: {z: null}}
"""
TABLE = """
parameters: {y2: null, sy2: null, zr: null, al: null, bl: null, cl: null, sq: null, ar: null, cr: null,
  kx: null, kd: null}
frames: {left: {turn: null}, right: null}
guides: {rail1: {at: [500, 0, 0], along: y}, rail2: null}
bodies:
  plate1: {guide: null, at: [0, 500, 0], fixed: true}
  plate2: {guide: null, at: [1000, 500, 0], fixed: true}
  table: {guide: rail1, at: 0, points: {mark: [0, 0, 50]}}
actuators: {Y1: {moves: table, stiffness: null, limits: [-450, 450]}, Y2: null}
sensors: {second: {kind: tcp, at: mark, reads: [x, y], sigma: 5 um, frame: machine}}
workspace: {box: {y: null}}
"""
SEVENTH = """
parameters: {b7x: -500, b7y: 0, b7z: 0, p7x: 250, p7y: 0, p7z: 0, o7: 450}
ground: {B7: [b7x, b7y, b7z]}
bodies: {platform: {points: {P7: [p7x, p7y, p7z]}}}
bars: {leg7: {between: [B7, P7], EA: 20 MN}, leg1: {EA: 20 MN}}
actuators: {q7: {drives: leg7, offset: o7, redundant: true}}
"""
NONE_BELOW = """
parameters: {A4x: null, A4y: null, A4z: null, z4: null, s4: null}
ground: {A4: null}
ropes: {cable4: null}
actuators: {q4: null}
"""
HELD = "actuators: {q4: {control: position, force: null, sigma: null}}\n"
ONE_DRIVE = "parameters: {y2: null, sy2: null}\nactuators: {Y2: null}\n"


@pytest.mark.parametrize(
    ("kind", "overlay", "counts"),
    [
        ("gantry", ONE_DRIVE, (3, 3, 0)),
        ("gantry", NO_RAM, (2, 3, 1)),
        ("gantry", X_RAILS, (3, 4, 1)),
        ("gantry", TABLE, (3, 3, 0)),
        ("hexapod", SEVENTH, (6, 7, 1)),
        ("cable", NONE_BELOW, (3, 3, 0)),
        ("cable", HELD, (3, 4, 1)),
    ],
)
def test_what_the_heads_say_can_be_changed(
    kind: str, overlay: str, counts: tuple[int, int, int], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Degrees of freedom, drives, redundancy."""
    monkeypatch.chdir(tmp_path)
    assert run("new", kind, "-q", "-o", "m.yaml").code == 0
    Path("other.yaml").write_text(f"extends: m.yaml\n{overlay}")
    done = run("check", "other.yaml", "--json")
    assert done.code == 0 and done.json["warnings"] == [], done.err
    found = done.json
    assert (found["degrees_of_freedom"], found["actuators"], found["degree_of_redundancy"]) == counts


@pytest.mark.slow
def test_the_squareness_of_a_clamped_beam_is_a_parameter(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Both rails 300 urad askew to a beam that keeps its direction, as errors of the guides: the parameter takes that
    up and nothing else does. A yaw of the rails (`cl`) turns the clamped beam with them.
    """
    monkeypatch.chdir(tmp_path)
    assert run("new", "gantry", "--span", "2 m", "-o", "m.yaml", "-q").code == 0
    askew = "{guide_angle@rail1.x: {g: 300 urad}, guide_angle@rail2.x: {g: 300 urad}}"
    Path("askew.yaml").write_text(f"extends: m.yaml\neffects: {askew}\n", encoding="utf-8")
    assert run("plan", "m.yaml", "--grid", "40", "-o", "poses.csv", "-q").code == 0
    measured = ("--noise", "declared", "--seed", "1", "-o", "table.csv", "-q")
    assert run("simulate", "askew.yaml", "poses.csv", *measured).code == 0
    found = run("calibrate", "m.yaml", "table.csv", "--holdout", "none", "--json", "-q").json
    values = {p["name"]: (p["value"] - p["nominal"], p["std"]) for p in found["parameters"] if p["std"] is not None}
    assert found["chi2_per_dof"] == pytest.approx(1.0, abs=0.3)
    assert abs(values["sq"][0] - 300e-6) < 3 * values["sq"][1] < 100e-6
    assert abs(abs(values["x0"][0]) - 0.3) < 3.5 * values["x0"][1]  # mm: guides turn about the middle of 2 m
    assert all(abs(off) < 3.5 * std for name, (off, std) in values.items() if name not in ("sq", "x0"))
