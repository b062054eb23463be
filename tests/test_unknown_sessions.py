"""Zeros of sessions that a calibration knows, and of those that it does not; the truth is a biglide in closed form."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np
import pytest
import yaml
from numpy.typing import NDArray

from tests.command import column, run

Array = NDArray[np.float64]
SIGMA, RANGE = 2e-3, 1.0  # mm
BIGLIDE = f"""
units: {{length: mm, angle: deg, force: N}}
space: planar
guides: {{rail: {{along: x}}}}
bodies:
  c1: {{guide: rail, at: 200, points: {{B1: [0, 60]}}}}
  c2: {{guide: rail, at: 800, points: {{B2: [0, 60]}}}}
nodes: {{tcp: [500, 400]}}
bars: {{rod1: {{between: [B1, tcp], length: l1}}, rod2: {{between: [B2, tcp], length: l2}}}}
parameters:
  l1: {{nominal: 450, range: 0.2}}
  l2: {{nominal: 450, range: 0.2}}
  z1: {{nominal: 0, range: {RANGE}, per: session}}
  z2: {{nominal: 0, range: {RANGE}, per: session}}
actuators: {{q1: {{moves: c1, zero: z1}}, q2: {{moves: c2, zero: z2}}}}
sensors: {{tracker: {{at: tcp, reads: [x, y], sigma: {SIGMA}, frame: machine}}}}
"""
ZEROS = {"mon": (0.41, -0.33), "tue": (-0.52, 0.24), "wed": (0.13, 0.61)}
RODS = (450.08, 449.94)
TARGETS = ((400.0, 320.0), (600.0, 430.0))


def tip(readings: Array, zeros: Array | tuple[float, float]) -> Array:
    """Where circles about both carriages, at y = 60, meet above them; readings (n, 2), zeros (2,) or (n, 2), mm."""
    carriages = readings + np.asarray(zeros)
    apart = carriages[:, 1] - carriages[:, 0]
    along = (apart**2 + RODS[0] ** 2 - RODS[1] ** 2) / (2 * apart)
    return np.column_stack([carriages[:, 0] + along, 60 + np.sqrt(RODS[0] ** 2 - along**2)])


def campaign(file: str, zeros: Mapping[str, tuple[float, float]], named: bool = True, seed: int = 0) -> None:
    """A table of 12 rows of each session."""
    rng, lines = np.random.default_rng(seed), [("session," if named else "") + "q1,q2,x,y"]
    for session, own in zeros.items():
        place = rng.uniform([350, 300], [650, 450], (12, 2))
        half = np.sqrt(450.0**2 - (place[:, 1] - 60) ** 2)
        readings = np.round(np.column_stack([place[:, 0] - half, place[:, 0] + half]), 4)
        seen = tip(readings, own) + rng.normal(0, SIGMA, (12, 2))
        rows = [",".join(repr(float(v)) for v in row) for row in np.hstack([readings, seen])]
        lines += [f"{session},{row}" if named else row for row in rows]
    Path(file).write_text("\n".join(lines) + "\n")


def targets(file: str, sessions: tuple[str, ...]) -> None:
    """The targets in each of some sessions; without a column where there are none."""
    rows = [f"{s},{x},{y}" for s in sessions for x, y in TARGETS] or [f"{x},{y}" for x, y in TARGETS]
    Path(file).write_text("\n".join([("session," if sessions else "") + "x,y", *rows]) + "\n")


def commands(file: str) -> Array:
    """Set values (n, 2) of a table."""
    return np.column_stack([column(file, "q1"), column(file, "q2")])


def stated(file: str) -> Array:
    """Standard uncertainties (n, 2) of a table, mm."""
    return 1e-3 * np.column_stack([column(file, "u.x"), column(file, "u.y")])


@pytest.fixture(autouse=True)
def _folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    Path("m.yaml").write_text(BIGLIDE)


def calibrated(zeros: Mapping[str, tuple[float, float]] = ZEROS, named: bool = True) -> None:
    campaign("c.csv", zeros, named)
    done = run("calibrate", "m.yaml", "c.csv", "--holdout", "none", "-o", "p.yaml", "--force")
    assert done.code == 0, done.err


def test_a_table_of_one_session_is_corrected_with_its_own_zeros() -> None:
    """As in a table of several, and so that the tool point is at the target, within five uncertainties of a few um."""
    calibrated()
    targets("all.csv", tuple(ZEROS))
    targets("tue.csv", ("tue",))
    assert run("correct", "m.yaml", "all.csv", "-p", "p.yaml", "-o", "all.out.csv").code == 0
    alone = run("correct", "m.yaml", "tue.csv", "-p", "p.yaml", "-o", "tue.out.csv")
    assert alone.code == 0 and "not known" not in alone.err and "z1[tue]" not in alone.err
    assert commands("tue.out.csv") == pytest.approx(commands("all.out.csv")[2:4], abs=1e-9)
    off = tip(commands("tue.out.csv"), ZEROS["tue"]) - TARGETS
    assert (np.abs(off) < 5 * stated("tue.out.csv")).all() and stated("tue.out.csv").max() < 0.01
    poses = "session,q1,q2\n" + "".join(f"tue,{a!r},{b!r}\n" for a, b in commands("tue.out.csv").tolist())
    Path("poses.csv").write_text(poses)
    assert run("simulate", "m.yaml", "poses.csv", "-p", "p.yaml", "-o", "read.csv").code == 0
    assert np.column_stack([column("read.csv", "x"), column("read.csv", "y")]) == pytest.approx(
        np.array(TARGETS), abs=1e-6
    )


@pytest.mark.parametrize("sessions", [("thu",), ()], ids=["another", "none"])
def test_zeros_of_a_session_without_measurements_are_as_uncertain_as_their_ranges(sessions: tuple[str, ...]) -> None:
    """True errors, over zeros drawn from the ranges, are as large as stated, to a tenth; it is said what is unknown."""
    calibrated()
    targets("t.csv", sessions)
    done = run("correct", "m.yaml", "t.csv", "-p", "p.yaml", "-o", "t.out.csv")
    zero = f"z1[{sessions[0]}]" if sessions else "z1"
    assert done.code == 0 and f"{zero}, " in done.err and "name a session that it knows (mon, tue, wed)" in done.err
    assert ("as no session is named" in done.err) is (not sessions)
    drawn = np.random.default_rng(1).normal(0, RANGE / 2, (4000, 2))
    for command, target, u in zip(commands("t.out.csv"), TARGETS, stated("t.out.csv"), strict=True):
        errors = tip(np.tile(command, (len(drawn), 1)), drawn) - target
        assert np.sqrt((errors**2).mean(axis=0)) == pytest.approx(u, rel=0.1)
    mapped = run("simulate", "m.yaml", "t.csv", "-p", "p.yaml", "--uncertainty", "-o", "map.csv")
    assert mapped.code == 0 and f"zeros of drives not known{'' if sessions else ', as no session'}" in mapped.err
    assert stated("map.csv") == pytest.approx(stated("t.out.csv"), rel=0.01)


def test_a_grid_is_corrected_for_a_session_that_is_named() -> None:
    calibrated()
    grid = ("correct", "m.yaml", "--grid", "x=400:600:2,y=320:320:1", "-o", "g.csv", "--force")
    done = run(*grid, "-p", "p.yaml", "--at", "session=wed")
    assert done.code == 0 and "not known" not in done.err
    assert Path("g.csv").read_text().count("wed") >= 2
    off = tip(commands("g.csv"), ZEROS["wed"]) - [[400, 320], [600, 320]]
    assert (np.abs(off) < 5 * stated("g.csv")).all() and stated("g.csv").max() < 0.01
    other = run(*grid, "-p", "p.yaml", "--at", "session=sun")
    assert other.code == 2 and "nothing is known of session `sun`" in other.err and "mon, tue, wed" in other.err
    assert "there is no parameter file" in run(*grid, "--at", "session=sun").err
    targets("t.csv", ("tue",))
    twice = run("correct", "m.yaml", "t.csv", "-p", "p.yaml", "--at", "session=wed")
    assert twice.code == 2 and "the table has a column `session`" in twice.err


def test_a_calibration_of_one_session_keeps_its_name() -> None:
    """Its zeros are not those of the next day; rows of other days are judged with zeros of their own."""
    calibrated({"mon": ZEROS["mon"]})
    targets("tue.csv", ("tue",))
    done = run("correct", "m.yaml", "tue.csv", "-p", "p.yaml", "-o", "tue.out.csv")
    assert done.code == 0 and "z1[tue], z2[tue]" in done.err and "it knows (mon)" in done.err
    off = tip(commands("tue.out.csv"), ZEROS["tue"]) - TARGETS
    assert (np.abs(off) < 3 * stated("tue.out.csv")).all()
    campaign("later.csv", {"tue": ZEROS["tue"], "wed": ZEROS["wed"]}, seed=5)
    later = run("check", "m.yaml", "later.csv", "-p", "p.yaml", "--json")
    verification = later.json["verification"]
    assert later.code == 0 and verification["compatible"]
    assert set(verification["fitted"]) == {f"{z}[{s}]" for z in ("z1", "z2") for s in ("tue", "wed")}


def test_values_without_a_session_are_of_tables_without_one() -> None:
    """They are used there, and of another session wherever sessions have names."""
    calibrated({"mon": ZEROS["mon"]}, named=False)
    targets("t.csv", ())
    done = run("correct", "m.yaml", "t.csv", "-p", "p.yaml", "-o", "t.out.csv")
    assert done.code == 0 and "not known" not in done.err
    assert (np.abs(tip(commands("t.out.csv"), ZEROS["mon"]) - TARGETS) < 5 * stated("t.out.csv")).all()
    targets("two.csv", ("tue", "wed"))
    named = run("correct", "m.yaml", "two.csv", "-p", "p.yaml", "-o", "two.out.csv")
    assert named.code == 0 and "values of a session without a name are not used: z1, z2" in named.err
    assert stated("two.out.csv").min() > 0.2
    campaign("later.csv", {"tue": ZEROS["tue"], "wed": ZEROS["wed"]}, seed=5)
    assert run("check", "m.yaml", "later.csv", "-p", "p.yaml").code == 0


USES = {
    "simulate": ("simulate", "-o", "-"),
    "correct": ("correct", "-o", "-"),
    "draw": ("draw",),
    "sensitivity": ("sensitivity",),
    "observability": ("observability",),
    "plan": ("plan",),
    "effects": ("effects", "--simulate"),
}
NEXT = ("--next", "--budget", "60", "--aim", "l1 10 um")
FITS = {"calibrate": (), "diagnose": (), "improve": (), "check": (), "plan": NEXT}


@pytest.mark.parametrize("command", USES)
def test_every_command_that_takes_values_as_they_are_says_which_zeros_it_lacks(command: str) -> None:
    """Of a session that the file does not know, of one of two, of rows that name none; not where it knows all."""
    calibrated()
    whole = yaml.safe_load(Path("p.yaml").read_text())["parameters"]
    some = {name: {k: entry[k] for k in ("value", "unit")} for name, entry in whole.items() if "[wed]" not in name}
    Path("by hand.yaml").write_text(yaml.safe_dump({"parameters": some}))
    cases = {("thu",): "z1[thu], z2[thu]", (): "as no session is named: z1, z2", ("tue", "mon"): ""}
    told = {}
    for sessions in (*cases, ("tue", "wed")):
        targets("t.csv", sessions)
        file = "by hand.yaml" if sessions == ("tue", "wed") else "p.yaml"
        done = run(*USES[command], "m.yaml", "t.csv", "-p", file)
        assert done.code == 0, done.err
        told[sessions] = [line for line in done.err.splitlines() if "zeros of drives not known" in line]
    assert all(lines[0].count(cases[s]) == 1 and len(lines) == 1 for s, lines in told.items() if cases.get(s))
    assert told["tue", "mon"] == [] and "z1[wed], z2[wed]" in told["tue", "wed"][0]


@pytest.mark.parametrize("command", FITS)
def test_commands_that_fit_the_zeros_lack_none(command: str) -> None:
    """But those that they are told to hold."""
    calibrated()
    campaign("thu.csv", {"thu": (0.2, 0.1), "fri": (-0.1, 0.3)}, seed=9)
    done = run(command, "m.yaml", "thu.csv", "-p", "p.yaml", *FITS[command])
    assert done.code in (0, 1) and "not known" not in done.err
    if command == "calibrate":
        held = run(command, "m.yaml", "thu.csv", "-p", "p.yaml", "--select", "l1,l2,z2,z1[fri]")
        assert "zeros of drives not known: z1[thu]: nominal" in held.err


def test_the_name_of_a_single_session_changes_names_alone() -> None:
    found = []
    for named in (True, False):
        campaign("c.csv", {"mon": ZEROS["mon"]}, named)
        result = run("calibrate", "m.yaml", "c.csv", "--json").json
        found.append({p["name"].removesuffix("[mon]"): (p["value"], p["std"]) for p in result["parameters"]})
    assert found[0] == {name: pytest.approx(numbers, rel=1e-9) for name, numbers in found[1].items()}
