"""Machines that nothing drives, and machines that nothing measures: what is possible is done, the rest is said."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from tests.command import MACHINES, column, run
from tests.computed_once import run_once

pytestmark = pytest.mark.usefixtures("unsized")

CANTILEVER = """
units: {length: mm, angle: deg, force: N}
space: planar
gravity: [0, -9.81]
ranges: {length: 0.1}
parameters: {EI: {nominal: 200, range: 40, unit: N*m^2}}
ground: {wall: [0, 0]}
nodes: {tip: [400, 0]}
beams: {beam: {between: [wall, tip], EI: EI}}
sensors: {dial: {at: tip, reads: [y], sigma: 1 um, frame: machine}}
effects: {payload@dial: {m: 1}}
"""
LENGTH, G = 0.4, 9.80665
PAYLOADS = [0.0, 0.1, 0.2, 0.4]


@pytest.fixture(autouse=True)
def _folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    Path("m.yaml").write_text(CANTILEVER)
    Path("plain.yaml").write_text(CANTILEVER[: CANTILEVER.index("effects")])
    Path("blind.yaml").write_text(CANTILEVER[: CANTILEVER.index("sensors")])
    Path("loads.csv").write_text("payload [kg]\n" + "\n".join(map(str, PAYLOADS)) + "\n")


def deflection(mass: float, stiffness: float = 200.0) -> float:
    """Of the tip under a weight, by Euler and Bernoulli, mm."""
    return -1e3 * mass * G * LENGTH**3 / (3 * stiffness)


def test_a_frame_is_simulated_under_the_loads_of_a_table_without_drives() -> None:
    """Against m g L^3 / 3 EI; the beam turns by 1e-3 rad, which is 1e-6 of the deflection."""
    done = run("simulate", "m.yaml", "loads.csv", "-o", "out.csv", "--forces")
    assert done.code == 0 and "4 rows simulated" in done.err
    expected = [deflection(m) for m in PAYLOADS]
    assert column("out.csv", "y") == pytest.approx(expected, rel=3e-6, abs=1e-9)
    energy = [0.5 * m * G * -1e-3 * y for m, y in zip(PAYLOADS, expected, strict=True)]
    assert column("out.csv", "strain_energy_J") == pytest.approx(energy, rel=1e-5, abs=1e-12)


def test_a_frame_is_simulated_as_it_stands() -> None:
    Path("loaded.yaml").write_text("extends: plain.yaml\nloads: {weight: {at: tip, force: [0, -3]}}\n")
    done = run("simulate", "loaded.yaml", "-o", "out.csv")
    assert done.code == 0 and "1 row simulated" in done.err
    assert column("out.csv", "y") == pytest.approx([deflection(3 / G)], rel=3e-6)
    Path("ids.csv").write_text("id\na\nb\n")
    assert run("simulate", "loaded.yaml", "ids.csv").out.count("\n") > 2
    Path("places.csv").write_text("y\n5\n")
    told = run("simulate", "loaded.yaml", "places.csv")
    assert told.code == 0 and "no actuator holds a position; the TCP coordinates are not used" in told.err
    grid = run("simulate", "loaded.yaml", "--grid", "y=0:1:2")
    assert grid.code == 2 and "the mechanism has no degree of freedom" in grid.err and "leave out `--grid`" in grid.err
    moving = run("simulate", MACHINES / "triglide.yaml")
    assert moving.code == 2 and "give either a table of poses or --grid" in moving.err


def test_a_drive_in_force_control_is_simulated_under_the_forces_of_a_table() -> None:
    """A slide on a spring: its place is force over stiffness."""
    Path("push.yaml").write_text(
        "units: {length: mm, force: N}\nspace: planar\nparameters: {k: {nominal: 50, range: 5, unit: N/mm}}\n"
        "ranges: {length: 0.1}\nground: {wall: [0, 0]}\nguides: {rail: {along: x}}\n"
        "bodies: {slide: {guide: rail, at: 100}}\nbars: {spring: {between: [wall, slide], k: k}}\n"
        "actuators: {f: {moves: slide, control: force, redundant: true, sigma: 1 um, force: {otherwise: 0}}}\n"
        "sensors: {scale: {at: slide, reads: [x], sigma: 1 um, frame: machine}}\n"
    )
    assert run("check", "push.yaml").code == 0
    Path("forces.csv").write_text("f.force [N]\n0\n10\n-25\n")
    done = run("simulate", "push.yaml", "forces.csv", "-o", "out.csv")
    assert done.code == 0, done.err
    assert column("out.csv", "x") == pytest.approx([100, 100.2, 99.5], abs=1e-9)


def table(stiffness: float, rows: int = 24) -> None:
    """Deflections of a beam of another stiffness, measured to 1 um."""
    rng = np.random.default_rng(0)
    payload = np.tile([0.1, 0.2, 0.3, 0.4, 0.5, 0.6], rows // 6)
    y = [deflection(m, stiffness) for m in payload] + rng.normal(0, 1e-3, rows)
    np.savetxt("t.csv", np.column_stack([payload, y]), "%.6f", ",", header="payload [kg],y [mm]", comments="")


def test_a_frame_is_calibrated_and_its_loads_are_held_out() -> None:
    """EI of 190 instead of 200 N m^2, within four standard uncertainties; folds keep the same loads together."""
    table(190.0)
    done = run("calibrate", "m.yaml", "t.csv", "--select", "EI", "--holdout", "3", "--json")
    assert done.code == 0, done.err
    (found,) = [p for p in done.json["parameters"] if p["name"] == "EI"]
    assert abs(found["value"] - 190) < 4 * found["std"] < 1
    assert done.json["heldout"]["after"]["position"]["rms"] < 2e-3
    (noise,) = done.json["replicates"]
    assert noise["n_groups"] == 6 and noise["degrees_of_freedom"] == 18


PORTAL = """
units: {length: mm, angle: deg, force: N}
space: planar
gravity: [0, -9.81]
ranges: {length: 0.1, force: 10}
parameters: {h: 500, F: {nominal: 100, range: 20, unit: N}}
ground: {A: [0, 0], B: [800, 0]}
nodes: {C: [0, 500], D: [800, 500], M: [400, 500]}
sections: {s: {square: 20}}
materials: {steel: {E: 210 GPa}}
beams:
  left: {between: [A, C], section: s, material: steel, length: h}
  right: {between: [B, D], section: s, material: steel}
  top1: {between: [C, M], section: s, material: steel}
  top2: {between: [M, D], section: s, material: steel}
loads: {push: {at: C, force: [F, 0]}}
sensors: {dial: {at: M, reads: [x, y], sigma: 1 um, frame: machine}}
"""


def test_a_frame_is_diagnosed_and_improved() -> None:
    """Weights hung on a portal that its file does not know are found, at the share that acts."""
    Path("portal.yaml").write_text(PORTAL)
    Path("hung.yaml").write_text("extends: portal.yaml\neffects: {payload@dial: {m: 1}}\n")
    Path("w.csv").write_text("payload [kg]\n" + "\n".join(str(k % 5) for k in range(40)) + "\n")
    assert run("simulate", "hung.yaml", "w.csv", "--noise", "declared", "--seed", "3", "-o", "t.csv").code == 0
    assert run("simulate", "hung.yaml", "w.csv", "--noise", "declared", "--seed", "4", "-o", "apart.csv").code == 0
    diagnosed = run_once("diagnose", "portal.yaml", "t.csv", "--json")
    assert [found["effect"] for found in diagnosed.json["effects"]] == ["payload"]
    assert "as weighed" in diagnosed.err, "no size that has been found"
    improved = run_once("improve", "portal.yaml", "t.csv", "--validation", "apart.csv", "-o", "better.yaml", "--json")
    assert improved.code == 0, improved.err
    again = run("calibrate", "better.yaml", "t.csv", "--holdout", "none", "--json").json
    assert "payload@dial.m" not in [p["name"] for p in again["parameters"]], "weighed in kg: all of it acts"
    assert again["chi2_per_dof"] < 1.5
    freed = "extends: better.yaml\neffects: {payload@dial: {m: {value: 1, identify: true}}}\n"
    Path("freed.yaml").write_text(freed)
    again = run("calibrate", "freed.yaml", "t.csv", "--holdout", "none", "--json").json
    (found,) = [p for p in again["parameters"] if p["name"] == "payload@dial.m"]
    assert found["identified"] and abs(found["value"] - 1) < 4 * found["std"] < 0.05


@pytest.mark.parametrize(
    ("entry", "exact"),
    [("1", True), ("{value: 1, identify: false}", True), ("{value: 1, range: 0.1, identify: false}", False)],
)
def test_the_share_of_a_weighed_payload_is_exact_unless_its_file_gives_a_range(entry: str, exact: bool) -> None:
    Path("portal.yaml").write_text(f"{PORTAL}effects: {{payload@dial: {{m: {entry}}}}}\n")
    Path("w.csv").write_text("payload [kg]\n" + "\n".join(str(k % 5) for k in range(40)) + "\n")
    assert run("simulate", "portal.yaml", "w.csv", "--noise", "declared", "--seed", "3", "-o", "t.csv").code == 0
    freed = run("calibrate", "portal.yaml", "t.csv", "--holdout", "none", "--select", "auto,payload@dial.m")
    assert freed.code == (2 if exact else 0), freed.err
    if exact:
        assert "write `m: {identify: true}` at `payload@dial` in `effects:` to identify it" in freed.err


def test_a_payload_and_a_soft_frame_are_told_apart() -> None:
    """A weight is weighed; so what the frame yields more is its own stiffness, and neither hides in the other."""
    Path("portal.yaml").write_text(PORTAL)
    planted = "extends: portal.yaml\neffects: {payload@dial: {m: 1}, stiffness@all: {k: -0.2}}\n"
    Path("hung.yaml").write_text(planted)
    Path("w.csv").write_text("payload [kg]\n" + "\n".join(str(k % 5) for k in range(40)) + "\n")
    assert run("simulate", "hung.yaml", "w.csv", "--noise", "declared", "--seed", "3", "-o", "t.csv").code == 0
    found = {e["effect"]: e for e in run_once("diagnose", "portal.yaml", "t.csv", "--json").json["effects"]}
    assert found.keys() == {"payload", "stiffness"}
    (k,) = found["stiffness"]["parameters"]
    assert abs(k["value"] + 0.2) < 4 * k["std"] < 0.05


def test_what_cannot_be_done_with_a_frame_is_said() -> None:
    table(200.0)
    for option in (["--aim", "EI"], ["--aim", "payload"], ["-o", "plan.csv"]):
        done = run("plan", "m.yaml", "t.csv", *option)
        assert done.code == 2 and "no actuator holds a position, so there are no points to choose" in done.err
    assert run("plan", "m.yaml", "t.csv").code == 0
    shown = run("check", "m.yaml", "--json")
    assert shown.code == 0 and "0 degrees of freedom, 0 actuators; a frame" in shown.err
    assert "not possible without actuators: grids, tables of poses; `simulate` shows the machine as it st" in shown.err
    assert [limit["lacking"] for limit in shown.json["limitations"]] == ["actuators"]
    assert run("check", MACHINES / "triglide.yaml", "--json").json["limitations"] == []


def test_what_cannot_be_done_without_sensors_is_said_by_check_and_by_every_command() -> None:
    table(200.0)
    shown = run("check", "blind.yaml", "--json")
    assert shown.code == 0
    limits = {limit["lacking"]: limit["rules_out"] for limit in shown.json["limitations"]}
    assert limits["sensors"] == ["observability", "calibrate", "diagnose", "improve", "plan"]
    assert "sensitivity" in limits["a tool point"]
    assert "not possible without sensors: observability, calibrate, diagnose, improve, plan; declare a sen" in shown.err
    for command in (["calibrate", "t.csv"], ["diagnose", "t.csv"], ["improve", "t.csv"], ["observability"], ["plan"]):
        done = run(command[0], "blind.yaml", *command[1:])
        assert done.code == 3 and "blind.yaml: error[sensors]: the machine has no sensors" in done.err, command
        assert done.err.count("error[") == 1 and "help: declare one, for example `sensors: {" in done.err
    checked = run("check", "blind.yaml", "t.csv")
    assert checked.code == 1 and "the machine has no sensors: nothing can be measured with it" in checked.err
    done = run("simulate", "blind.yaml", "loads.csv", "--forces", "-o", "out.csv")
    assert done.code == 0 and "note: the machine has no sensors: the table has no readings" in done.err
    assert len(column("out.csv", "strain_energy_J")) == 4


def test_machines_without_sigma_or_parameters_say_so_in_check() -> None:
    bare = "units: {length: mm}\nspace: planar\nguides: {r: {along: x}}\nbodies: {c: {guide: r, at: 0}}\n"
    Path("bare.yaml").write_text(bare + "actuators: {q: {moves: c}}\ntool_point: c\n")
    limits = {x["lacking"]: x["rules_out"] for x in run("check", "bare.yaml", "--json").json["limitations"]}
    assert set(limits) == {"sensors", "parameters"} and "sensitivity" in limits["parameters"]
    Path("mute.yaml").write_text(
        bare.replace("{c: {guide: r, at: 0}}", "{c: {guide: r, at: 0}, d: {guide: r, at: 90}}")
        + "actuators: {q: {moves: c}, p: {moves: d, control: passive, redundant: true}}\n"
        + "bars: {rod: {between: [c, d], length: 90, k: 1 kN/mm}}\ntool_point: c\n"
    )
    limits = {x["lacking"]: x["rules_out"] for x in run("check", "mute.yaml", "--json").json["limitations"]}
    assert "a `sigma`" in limits and "calibrate" in limits["a `sigma`"]
