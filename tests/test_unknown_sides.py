"""The first row of a session: nobody knows from which side its drives came, so a reversal is uncertainty there."""

from __future__ import annotations

import csv
import re
from pathlib import Path

import numpy as np
import pytest

from pkmcal_cli.calibration.problem import design_problem
from pkmcal_cli.calibration.unknown_sides import with_unknown_sides
from pkmcal_cli.loading.load_machine import load_machine, load_measurements
from pkmcal_cli.prediction import Request, Rows, predict
from tests.command import HANGPRINTER, HANGPRINTER_DATA, MACHINES, SCISSORS, run

pytestmark = pytest.mark.usefixtures("unsized")

TRIGLIDE = MACHINES / "triglide-nonredundant.yaml"
TABLE = MACHINES / "triglide-nonredundant.csv"


def worn(folder: Path, machine: str | Path, effect: str) -> str:
    file = folder / "worn.yaml"
    file.write_text(f"extends: {machine}\neffects: {{{effect}}}\n", encoding="utf-8")
    return str(file)


@pytest.mark.parametrize(
    ("machine", "table", "effect", "drive"),
    [
        (SCISSORS, str(MACHINES / "scissors.csv"), "backlash@q3: {b: 12 um}", "q3"),
        (SCISSORS, str(MACHINES / "scissors.csv"), "windup@q1: {w: 1 um/kN}", "q1"),
        (HANGPRINTER, HANGPRINTER_DATA, "backlash@A: {b: 2 mm}", "A"),
    ],
)
def test_half_of_what_both_sides_differ_by(tmp_path: Path, machine: str, table: str, effect: str, drive: str) -> None:
    """By the readings of both sides, of a drive, of one that winds up under its force, of a spool."""
    loaded = load_machine(worn(tmp_path, machine, effect))
    some = Rows.at(np.asarray(load_measurements(loaded, [table]).actuators, dtype=float)[:3])
    names = [a.name for a in loaded.model.actuators]

    def at(side: float) -> Rows:
        return Rows(some.readings, some.forces, {f"dir.{n}": np.full(3, side if n == drive else 1.0) for n in names})

    ahead, back = (predict(loaded.model, loaded.model.nominal, at(s)).values for s in (1.0, -1.0))
    problem = with_unknown_sides(design_problem(loaded.model, at(0.0)), values=loaded.model.nominal)
    assert problem.side_sigma is not None
    assert (problem.side_sigma > 0).tolist() == [[n == drive for n in names]] * 3
    middle = predict(loaded.model, loaded.model.nominal, at(0.0), Request(by_drive=True)).by_drive
    assert middle is not None
    half = (middle * (problem.side_sigma / loaded.model.gains)[:, None]).sum(axis=2)
    assert np.abs(half) == pytest.approx(0.5 * np.abs(ahead - back), rel=0.02, abs=1e-7)


def rows_of(table: Path) -> list[dict[str, str]]:
    lines = table.read_text(encoding="utf-8").splitlines()
    return list(csv.DictReader(line for line in lines if line[:1] != "#"))


@pytest.fixture
def sessions(tmp_path: Path) -> tuple[str, str, str]:
    """A worn Triglide and two tables of it without sides; before its first rows all drives moved upwards."""
    poses = [line for line in TABLE.read_text(encoding="utf-8").splitlines() if line[:1] != "#"]
    tables = []
    for seed in (1, 2):
        asked, table = tmp_path / "asked.csv", tmp_path / f"t{seed}.csv"
        first = [f"{poses[1]},1,1,1", *(f"{line},,," for line in poses[2 + 40 * seed : 42 + 40 * seed])]
        asked.write_text("\n".join([f"{poses[0]},dir.q1,dir.q2,dir.q3", *first]), encoding="utf-8")
        machine = worn(tmp_path, TRIGLIDE, "backlash@q2: {b: 200 um}")
        noisy = ("--noise", "declared", "--seed", str(seed))
        assert run("simulate", machine, asked, *noisy, "-o", table, "--force").code == 0
        lines = [line.split(",") for line in table.read_text(encoding="utf-8").splitlines() if line[:1] != "#"]
        kept = [k for k, name in enumerate(lines[0]) if not name.startswith("dir.")]
        table.write_text("".join(",".join(line[k] for k in kept) + "\n" for line in lines), encoding="utf-8")
        tables.append(str(table))
    return worn(tmp_path, TRIGLIDE, "backlash@q2: {b: {identify: true, range: 300 um}}"), tables[0], tables[1]


def test_they_neither_bend_a_fit_nor_contradict_it(sessions: tuple[str, str, str], tmp_path: Path) -> None:
    machine, before, after = sessions
    params = tmp_path / "p.yaml"
    fitted = run("calibrate", machine, before, "-o", params, "--json", "--holdout", "none")
    assert 0.6 < fitted.json["chi2_per_dof"] < 1.4
    (b,) = (p for p in fitted.json["parameters"] if p["name"] == "backlash@q2.b")
    assert abs(b["value"] - 200) < 3 * b["std"] < 30
    assert re.search(r"note: .*t1\.csv:2.*: from which side q2 came is unknown", fitted.err)
    assert "state `dir.q2`" in fitted.err
    assert fitted.json["after"]["position"]["max"] < 0.05, "mm; the first row is off by half of 0.2 mm"
    assert "unexplained" not in params.read_text(encoding="utf-8")
    done = run("check", machine, after, "-p", params, "--json")
    verified = done.json["verification"]
    assert verified["compatible"] and not [a for a in verified["above"] if a["line"] == 2]
    assert re.search(r"t2\.csv:2 .*: from which side q2 came is unknown", done.err)
    done = run("check", machine, after, "-p", params, "--json", "--tolerance", "60 um")
    judged = done.json["verification"]["tolerance"]
    assert (judged["verdict"], judged["n_fail"], judged["n_undecided"]) == ("undecided", 0, 1)


def test_they_are_no_bad_rows_once_the_reversal_is_known(sessions: tuple[str, str, str]) -> None:
    done = run("diagnose", TRIGLIDE, sessions[1], "--json")
    assert [(e["effect"], e["at"]) for e in done.json["effects"]] == [("backlash", "q2")]
    assert not done.json["outliers"]


def test_commands_say_what_a_row_without_a_side_may_be_off(sessions: tuple[str, str, str], tmp_path: Path) -> None:
    """u of the first target is larger than with a stated side by half of what both sides are apart, and no other's."""
    machine, before, _ = sessions
    params, shown, ends = tmp_path / "p.yaml", {}, []
    assert run("calibrate", machine, before, "-o", params, "-q", "--holdout", "none").code == 0
    for side in ("", "1"):
        targets, out = tmp_path / "targets.csv", tmp_path / f"commands{side}.csv"
        targets.write_text(f"x [mm],y [mm],dir.q1,dir.q2\n0,240,1,{side}\n60,260,,\n", encoding="utf-8")
        assert run("correct", machine, targets, "-p", params, "-o", out).code == 0
        shown[side] = [np.array([row["u.x [um]"], row["u.y [um]"]], dtype=float) for row in rows_of(out)]
    commands = (tmp_path / "commands1.csv").read_text(encoding="utf-8")
    for side in ("1", "-1"):
        from_side, out = tmp_path / "from.csv", tmp_path / "there.csv"
        from_side.write_text(commands.replace("\n1,1,1,", f"\n1,1,{side},"), encoding="utf-8")
        assert run("simulate", machine, from_side, "-p", params, "-o", out, "--force").code == 0
        ends.append(np.array([rows_of(out)[0][f"{c} [mm]"] for c in "xy"], dtype=float) * 1e3)
    apart = np.abs(ends[0] - ends[1])
    assert apart.max() > 100 and shown[""][0] == pytest.approx(np.hypot(shown["1"][0], apart / 2), rel=0.02)
    assert shown[""][1] == pytest.approx(shown["1"][1], rel=0.02)


def test_machines_without_reversal_have_none() -> None:
    assert "from which side" not in run("calibrate", TRIGLIDE, TABLE, "--holdout", "none").err
