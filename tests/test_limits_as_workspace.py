"""Machines that state only the limits of their drives: poses are spread between these, against closed forms."""

from __future__ import annotations

import csv
import io
import re
from pathlib import Path

import numpy as np
import pytest

from pkmcal_cli.base.rotation import Array
from tests.command import MACHINES, run
from tests.tool_machines import CRANK

SLIDERS = """
units: {length: mm, angle: deg, force: N}
space: planar
ranges: {length: 0.1}
parameters: {l1: 400, l2: 400, b: 50}
guides: {rail: {along: x}}
bodies:
  c1: {guide: rail, at: 235, points: {B1: [0, b]}}
  c2: {guide: rail, at: 765, points: {B2: [0, b]}}
nodes: {tcp: [500, 350]}
bars:
  rod1: {between: [B1, tcp], length: l1, k: 60 kN/mm}
  rod2: {between: [B2, tcp], length: l2, k: 60 kN/mm}
actuators:
  q1: {moves: c1, limits: [0, 400]}
  q2: {moves: c2, limits: [600, 1000]}
sensors: {tracker: {at: tcp, reads: [x, y], sigma: 5 um, frame: machine}}
"""
THIRD = """
extends: sliders.yaml
parameters: {l3: 700}
bodies: {c3: {guide: rail, at: 1130, points: {B3: [0, b]}}}
bars: {rod3: {between: [B3, tcp], length: l3, k: 60 kN/mm}}
actuators: {q3: {moves: c3, redundant: true, limits: [1000, 1100]}}
"""
INCHES = CRANK.replace("units: {length: mm", "units: {length: in")
NOTE = "the machine file has no `workspace`: poses are spread between the `limits` of the drives"


@pytest.fixture(autouse=True)
def _folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    Path("sliders.yaml").write_text(SLIDERS)
    Path("third.yaml").write_text(THIRD)


def over(machine: str, actuators: str) -> str:
    """A file of the machine with other actuators' keys, and its name."""
    Path("over.yaml").write_text(f"extends: {machine}\nactuators: {{{actuators}}}\n")
    return "over.yaml"


def simulated(machine: str, number: int) -> tuple[Array, str]:
    """Columns of the table (N, ...) that `simulate --grid N` writes, without the first, and what is said."""
    done = run("simulate", machine, "--grid", str(number))
    assert done.code == 0, done.err
    rows = list(csv.reader(io.StringIO("".join(x for x in done.out.splitlines(True) if not x.startswith("#")))))
    return np.array([row[1:] for row in rows[1:]], dtype=float), done.err


def test_positions_between_limits_fill_what_can_be_reached() -> None:
    """Two rods of 400 mm meet where their carriages are less than 800 mm apart: 7/8 of the square of limits."""
    table, said = simulated("sliders.yaml", 400)
    q1, q2, x, y = table.T
    half = (q2 - q1) / 2
    assert x == pytest.approx(q1 + half, abs=1e-6) and y == pytest.approx(50 + np.sqrt(400**2 - half**2), abs=1e-6)
    assert len(q1) == 400 and half.max() < 400
    assert q1.min() < 4 and q1.max() > 396 and q2.min() < 604 and q2.max() > 994
    cells = np.histogram2d(q1, q2, bins=2, range=[[0, 400], [600, 1000]])[0] / 400
    assert cells == pytest.approx(np.array([[2, 1], [2, 2]]) / 7, abs=0.02)
    lost, tried = (int(n) for n in re.findall(r"(\d+) of (\d+) drive positions tried", said)[0])
    assert NOTE in said and lost / tried == pytest.approx(1 / 8, abs=0.01)


def test_limits_of_a_redundant_drive_leave_what_closes() -> None:
    """The third carriage follows: x + sqrt(700^2 - (y - 50)^2), which is to be between 1000 and 1100 mm."""
    table, said = simulated("third.yaml", 100)
    q1, q2, q3 = table[:, :3].T
    x, y = (q1 + q2) / 2, np.sqrt(400**2 - (q2 - q1) ** 2 / 4)
    assert q3 == pytest.approx(x + np.sqrt(700**2 - y**2), abs=1e-6)
    assert q3.min() >= 1000 and q3.max() <= 1100 and np.ptp(q3) > 95 and np.ptp(q1) > 250
    rng = np.random.default_rng(1)
    a, b = rng.uniform(0, 400, 10**6), rng.uniform(600, 1000, 10**6)
    third = (a + b) / 2 + np.sqrt(700**2 - 400**2 + (b - a) ** 2 / 4)
    share = 1 - ((b - a < 800) & (third >= 1000) & (third <= 1100)).mean()
    lost, tried = (int(n) for n in re.findall(r"(\d+) of (\d+) drive positions tried", said)[0])
    assert lost / tried == pytest.approx(share, abs=0.03)


def test_inches_and_degrees_of_an_overlay() -> None:
    """A crank on a slide, of 200 and 40 inches here: what is read is in the file's units."""
    Path("crank.yaml").write_text(INCHES)
    table, said = simulated(over("crank.yaml", "q: {limits: [95, 107]}, a: {limits: [-60, 70]}"), 60)
    q, a = table[:, :2].T
    assert 95 <= q.min() < 95.5 and 106.5 < q.max() <= 107 and -60 <= a.min() < -55 and 60 < a.max() <= 70
    turn = np.radians(a)
    assert table[:, 2] == pytest.approx(q + 200 * np.cos(turn) - 40 * np.sin(turn), abs=1e-6)
    assert table[:, 3] == pytest.approx(200 * np.sin(turn) + 40 * np.cos(turn), abs=1e-6)
    assert NOTE in said and "out of reach" not in said


def test_counts_are_readings_of_limits() -> None:
    table, _ = simulated(over("sliders.yaml", "q1: {unit: {step: 10 um}, limits: [0, 40000]}"), 50)
    assert table[:, 0].min() >= 0 and 38000 < table[:, 0].max() <= 40000


def test_every_command_takes_limits_where_no_workspace_is() -> None:
    for command in ("plan", "observability", "sensitivity"):
        done = run(command, "sliders.yaml", "--json")
        assert done.code == 0 and done.json["n_rows"] == 50 and done.err.count(NOTE) == 1
    for command, *more in (("correct", "--grid", "9"), ("study", "--points", "9", "--repeat", "2")):
        done = run(command, "sliders.yaml", *more)
        assert done.code == 0 and done.err.count(NOTE) == 1, done.err


@pytest.mark.parametrize(
    ("actuators", "lacking"), [("q2: {limits: null}", "q2"), ("q1: {limits: null}, q2: {limits: null}", "q1, q2")]
)
def test_without_all_limits_nothing_is_taken(actuators: str, lacking: str) -> None:
    file = over("sliders.yaml", actuators)
    done = run("simulate", file, "--grid", "9")
    assert done.code == 2 and "the machine declares none" in done.err
    assert f"add `workspace:` to the machine file, or `limits` to {lacking}, or give axes" in done.err
    assert run("plan", file).code == 2 and run("study", file).code == 2
    assert "only the reference configuration is used" in run("observability", file).err


def test_redundant_drives_need_no_limits() -> None:
    assert run("simulate", over("third.yaml", "q3: {limits: null}"), "--grid", "9").code == 0


def test_without_a_tool_point_the_reference_configuration_is_left() -> None:
    wire = "ground: {O: [0, -100]}\nsensors: {tracker: null, wire: {kind: distance, at: tcp, to: O, sigma: 1 mm}}\n"
    Path("wire.yaml").write_text(f"extends: sliders.yaml\n{wire}")
    done = run("observability", "wire.yaml")
    assert done.code == 0 and "only the reference configuration is used" in done.err


@pytest.mark.parametrize(
    ("keys", "told"),
    [
        ("actuators: {q1: {limits: [0, 4]}, q2: {limits: [900, 1000]}}", "between the `limits` of its drives"),
        ("workspace: {drives: {q1: [0, 9], q2: [900, 999]}}", "of its workspace"),
    ],
)
def test_limits_between_which_nothing_closes(keys: str, told: str) -> None:
    Path("far.yaml").write_text(f"extends: sliders.yaml\n{keys}\n")
    done = run("plan", "far.yaml")
    assert done.code == 3 and f"far.yaml:2:1: error[workspace]: the machine reaches no pose {told}" in done.err


def test_a_declared_workspace_goes_before_limits() -> None:
    Path("boxed.yaml").write_text("extends: sliders.yaml\nworkspace: {box: {x: [450, 550], y: [300, 350]}}\n")
    table, said = simulated("boxed.yaml", 30)
    assert NOTE not in said and table[:, 2].min() >= 450 and table[:, 2].max() <= 550


def test_a_study_draws_no_point_beyond_limits(monkeypatch: pytest.MonkeyPatch) -> None:
    """In a box that reaches further than the drives."""
    from pkmcal_cli.calibration.study import Region

    seen: list[Array] = []
    real = Region.drawn
    monkeypatch.setattr(Region, "drawn", lambda *a: seen.extend(real(*a)) or real(*a))
    assert run("study", "sliders.yaml", "--within", "x=200:800,y=60:440", "--points", "9", "--repeat", "2").code == 0
    q = np.concatenate(seen) * 1e3
    assert q[:, 0].min() >= 0 and q[:, 0].max() <= 400 and q[:, 1].min() >= 600 and q[:, 1].max() <= 1000


def test_the_shipped_gantry_is_planned_between_its_limits() -> None:
    Path("gantry.yaml").write_text(f"extends: {MACHINES / 'gantry.yaml'}\nworkspace: null\n")
    table, _ = simulated("gantry.yaml", 40)
    assert table[:, :2].min() >= 0 and table[:, :2].max() <= 1800 and np.ptp(table[:, 0]) > 1600
    assert table[:, 2].min() >= 100 and table[:, 2].max() <= 1400
