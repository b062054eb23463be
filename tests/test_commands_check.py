"""`pkmcal check`: what the machine is, every fault in machine and data, exit codes."""

from __future__ import annotations

from pathlib import Path

import pytest

from pkmcal_cli.language.checks.consistency import RESERVED
from pkmcal_cli.loading.load_machine import load_machine
from tests.command import HANGPRINTER, MACHINES, SCISSORS, TRIGLIDE, TRIGLIDE_DATA, run

HERE = Path(__file__).parent
MECHANISM = sorted(path.stem for path in (HERE / "bad" / "mechanism").glob("*.expected"))
SHIPPED = sorted(p.stem for p in MACHINES.glob("*.yaml") if "." not in p.stem)


@pytest.fixture(autouse=True)
def _folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)


@pytest.mark.parametrize("name", MECHANISM)
def test_faulty_mechanisms_say_exactly_what_is_wrong(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """Machine files in tests/bad/mechanism with the message beside each; a first line `exit N` is the exit code."""
    monkeypatch.chdir(HERE / "bad" / "mechanism")
    code, _, expected = Path(f"{name}.expected").read_text().partition("\n")
    done = run("check", f"{name}.yaml", "-q")
    assert done.err == expected
    assert code == f"exit {done.code}"


@pytest.mark.parametrize("name", SHIPPED)
def test_shipped_machines_have_no_faults(name: str) -> None:
    done = run("check", MACHINES / f"{name}.yaml", "--json")
    assert done.code == 0 and done.json["ok"] and done.json["faults"] == [], done.err
    assert {w["code"] for w in done.json["warnings"]} <= {"substructure"}  # of the paper's machines


@pytest.mark.parametrize("name", SHIPPED)
def test_shipped_data_have_no_faults(name: str) -> None:
    tables = sorted(MACHINES.glob(f"{name}_*.csv")) or [MACHINES / f"{name}.csv"]
    done = run("check", MACHINES / f"{name}.yaml", *tables, "--json")
    few = {"delta-printer": 11}
    assert done.code == 0 and done.json["measurements"]["n_values"] >= few.get(name, 100), done.err
    assert len(done.json["measurements"]["sessions"]) == len(tables)


def test_what_a_machine_is_is_told() -> None:
    done = run("check", SCISSORS, "--json")
    result = done.json
    assert (result["degrees_of_freedom"], result["actuators"], result["degree_of_redundancy"]) == (2, 4, 2)
    assert result["bodies"] == 5 and result["elements"] == {"beams": 0, "bars": 5, "ropes": 0, "joints": 0}
    assert result["channels"] == ["x", "y"] and result["self_stress"] == 0
    l1 = next(p for p in result["parameters"] if p["name"] == "l1")
    assert l1 == {"name": "l1", "nominal": 950.0, "range": 0.1, "unit": "mm", "identify": False, "fixed": False}
    for text in (
        "planar, 5 bodies, 5 bars",
        "2 degrees of freedom, 4 actuators; degree of redundancy: 2",
        "not identified",
    ):
        assert text in done.err


def test_free_motions_and_self_stress_are_told() -> None:
    done = run("check", MACHINES / "delta4.yaml", "--json")
    assert done.json["self_stress"] > 0 and "not caused by a drive" in done.err
    Path("m.yaml").write_text(
        "units: {length: mm}\nspace: spatial\nground: {o: [0, 0, 0]}\n"
        "nodes: {n: [0, 0, 100]}\nbodies: {p: {at: [0, 0, 100], points: {c: [0, 0, 50]}}}\n"
        "bars: {b: {between: [o, n], length: {drive: q, offset: 100}}}\n"
        "joints: {s: {between: [n, p], type: spherical}}\nactuators: {q: {extends: b}}\n"
    )
    found = run("check", "m.yaml")
    assert found.code == 1, "named, not silently held"


def test_drives_are_told_with_their_role() -> None:
    done = run("check", HANGPRINTER)
    assert "redundant, force-controlled" in done.err and "Actuators in the reference configuration" in done.err


def test_every_fault_in_a_table_is_one_of_check() -> None:
    Path("m.csv").write_text("q1,q2,q3,x,y\n1,2,abc,4,5\n1,2,3,4\n")
    done = run("check", TRIGLIDE, "m.csv", "--json")
    assert done.code == 1 and not done.json["ok"]
    assert [(f["file"], f["line"]) for f in done.json["faults"]] == [("m.csv", 2), ("m.csv", 3)]
    assert done.json["measurements"]["n_rows"] is None
    assert "degrees of freedom" in done.err, "the machine is told all the same"


def test_rows_out_of_reach_and_gross_mistakes_are_faults() -> None:
    lines = Path(TRIGLIDE_DATA).read_text().splitlines()
    Path("m.csv").write_text("\n".join([lines[0].replace("x [mm],y [mm]", "y [mm],x [mm]"), *lines[1:50]]) + "\n")
    done = run("check", TRIGLIDE, "m.csv", "--json")
    assert done.code == 1 and "`x` and `y` look swapped" in done.json["faults"][0]["message"]
    Path("far.csv").write_text("id,q1,q2,q3,x,y\nk1,117,9603,947,360,275\nk2,117,603,947,360,275\n")
    far = run("check", TRIGLIDE, "far.csv", "--json")
    assert far.code == 1
    assert "far.csv:2: error[row]: row `k1`: out of reach: the mechanism cannot be assembled" in far.err
    assert [(f["line"], f["code"]) for f in far.json["faults"]] == [(2, "row")]


def test_at_most_fifty_faults_are_told_and_all_counted() -> None:
    Path("far.csv").write_text("q1,q2,q3,x,y\n" + "117,9603,947,360,275\n" * 80)
    done = run("check", TRIGLIDE, "far.csv", "--json")
    assert done.json["n_faults"] >= 80 and len(done.json["faults"]) == 50
    assert "more faults" in done.err


def test_readings_beyond_all_measure_and_none_at_all() -> None:
    Path("huge.csv").write_text("q1,q2,q3,x,y\n116.33,603.67,946.83,1e300,275\n")
    done = run("check", TRIGLIDE, "huge.csv")
    assert done.code == 1 and "huge.csv:2: error[row]: the reading of `x` is far outside the machine" in done.err
    assert run("calibrate", TRIGLIDE, "huge.csv").code == 3
    Path("empty.csv").write_text("q1,q2,q3,x,y\n116.33,603.67,946.83,,\n")
    for command, code in (("check", 1), ("calibrate", 3)):
        none = run(command, TRIGLIDE, "empty.csv")
        assert none.code == code and "nothing was measured: the cells of all channels are empty" in none.err


def test_faults_in_the_machine_come_as_json_too() -> None:
    Path("m.yaml").write_text("space: planar\nnodes: {a: [0, 0, 0]}\nbars: {}\nbarss: 3\n")
    done = run("check", "m.yaml", "--json")
    assert done.code == 1 and done.json["n_faults"] == len(done.json["faults"]) >= 2
    fault = next(f for f in done.json["faults"] if f["code"] == "unknown-key")
    assert (fault["file"], fault["line"], fault["column"]) == ("m.yaml", 4, 1)
    assert fault["help"] == "did you mean `bars`?"


def test_what_cannot_be_read_has_not_been_checked() -> None:
    Path("folder").mkdir()
    for name in ("nope.yaml", "folder"):
        assert run("check", name).code == 3
        assert run("check", TRIGLIDE, name).code == 3
    near = run("check", TRIGLIDE, "none.csv")
    assert near.out == "" and "none.csv:1: error[file]: the file does not exist" in near.err


def test_several_shipped_machines_are_called_by_their_names() -> None:
    done = run("check", "scissors", "triglide")
    assert done.code == 0 and all(f"{name}.yaml: " in done.out + done.err for name in ("scissors", "triglide"))


def test_quiet_shows_faults_only() -> None:
    assert run("check", TRIGLIDE, "-q").err == ""
    Path("m.yaml").write_text(Path(TRIGLIDE).read_text().replace(", redundant: true", ""))
    assert run("check", "m.yaml", "-q").err.startswith("m.yaml:")


def test_warnings_do_not_count() -> None:
    Path("m.yaml").write_text(Path(TRIGLIDE).read_text().replace("nominal: 50000, range", "nominal: 5e9, range", 1))
    done = run("check", "m.yaml", "--json")
    assert done.code == 0 and done.json["warnings"] and "warning[magnitude]" in done.err


def test_names_of_columns_that_every_table_may_have_are_reserved() -> None:
    from pkmcal_cli.tables.columns import columns_of

    plain = {c.name for c in columns_of(load_machine(TRIGLIDE).machine) if c.role in ("label", "covariate")}
    assert {name for name in plain if "." not in name} == RESERVED
    text = Path(TRIGLIDE).read_text()
    for name in sorted(RESERVED):
        Path("m.yaml").write_text(text.replace("  q1: {moves", f"  {name}: {{moves"))
        done = run("check", "m.yaml")
        assert done.code == 1 and f"the column name `{name}` is reserved" in done.err


def test_a_small_gap_of_the_drawing_is_told_and_no_fault() -> None:
    text = Path(TRIGLIDE).read_text()
    text = text.replace("nodes: {tcp: [360, 275]}", "ground: {a: [0, 0], b: [400, 0], c: [200, -300]}\n"
                        "nodes: {top: [200, 600], tcp: [360, 275]}")  # fmt: skip
    text = text.replace("bars:\n", "bars:\n  left: {between: [a, top], length: 632, k: k1}\n"
                        "  right: {between: [b, top], k: k1}\n  brace: {between: [c, top], k: k1}\n")  # fmt: skip
    Path("m.yaml").write_text(text)
    done = run("check", "m.yaml", "--json")
    assert done.code == 0 and done.json["self_stress"] == 1
    assert {g["element"] for g in done.json["gaps"]} == {"left", "right", "brace"}
    assert "warning[drawing]: the reference configuration does not close: gap of 0." in done.err
    Path("m.yaml").write_text(text.replace("length: 632", "length: 732"))
    assert run("check", "m.yaml").code == 1


def test_a_drive_drawn_outside_its_limits_is_warned_of(tmp_path: Path) -> None:
    machine = tmp_path / "m.yaml"
    machine.write_text(f"extends: {TRIGLIDE}\nactuators: {{q1: {{limits: [0, 100]}}, q2: {{limits: [0, 1000]}}}}\n")
    done = run("check", machine, "--json")
    assert done.code == 0
    (warning,) = done.json["warnings"]
    assert (
        warning["message"].startswith("`q1` reads 116.33 mm in the reference configuration")
        and "(0 mm to 100 mm)" in warning["message"]
    )


@pytest.mark.parametrize(
    ("old", "new", "told"),
    [
        pytest.param("q1 [mm],q2 [mm]", "q2 [mm],q1 [mm]", "`q1` and `q2` look swapped", marks=pytest.mark.slow),
        ("q1 [mm]", "q1 [m]", "`q1` looks 1000 times too large"),
    ],
)
def test_wrong_drive_columns_are_named_before_the_rows_that_they_spoil(old: str, new: str, told: str) -> None:
    """Where rows have no solution, the drives are compared with where they should be at the measured poses."""
    Path("m.csv").write_text(Path(TRIGLIDE_DATA).read_text().replace(old, new))
    done = run("check", TRIGLIDE, "m.csv", "-q")
    assert done.code == 1 and done.err.startswith(f"m.csv: error[plausibility]: {told}")
    fit = run("calibrate", TRIGLIDE, "m.csv", "--holdout", "none")
    assert fit.code == 3 and f"warning: {told}" in fit.err


def test_rows_with_a_partner_are_not_taken_silently(tmp_path: Path) -> None:
    table = tmp_path / "m.csv"
    table.write_text("id,q1,q2,q3,x,y,to\na,116.33,603.67,946.83,360,275,\nb,117,603,947,360,275,a\n")
    done = run("check", TRIGLIDE, table)
    assert "`to` names another row in 1 of 2 rows, but the machine has no `span` sensor: not used" in done.err


def test_what_nobody_says_how_surely_it_was_read(tmp_path: Path) -> None:
    """A passive drive is not one more actuator; without a sigma its encoder is not used, which is told."""
    file, table = tmp_path / "m.yaml", MACHINES / "scissors.csv"
    text = f"extends: {MACHINES / 'scissors.yaml'}\nactuators: {{q3: {{control: passive}}}}\n"
    file.write_text(text, encoding="utf-8")
    done = run("check", file, table, "--json")
    assert (done.json["actuators"], done.json["passive"], done.json["degree_of_redundancy"]) == (3, 1, 1)
    said = "`q3` not used in 80 rows: neither the machine file nor the table gives a sigma"
    assert said in done.err and said in run("calibrate", file, table, "--holdout", "none").err
    file.write_text(text.replace("passive", "passive, sigma: 1 um"), encoding="utf-8")
    assert said not in run("calibrate", file, table, "--holdout", "none").err


IDLE_POINTS = """
units: {length: mm}
space: planar
ranges: {length: 0.1}
parameters: {l1: 300, l2: 300}
guides: {rail: {along: x}}
bodies:
  c1: {guide: rail, at: 0, points: {lone: [0, 1]}}
  c2: {guide: rail, at: 300, points: {"P{i}": {each: {i: [1, 2, 3]}, at: ["{i}", 0]}}}
nodes: {n: {at: [150, 250]}}
bars: {b1: {between: [c1, n], length: l1}, b2: {between: [P2, n], length: l2}}
actuators: {q1: {moves: c1}, q2: {moves: c2, limits: [0, 20]}}
sensors: {t: {at: n, reads: [x, y], sigma: 10 um, frame: machine}}
"""


def test_names_that_nothing_uses_are_told_once_and_by_check_alone() -> None:
    """They change no result; what may spoil results, here a drive beyond its limits, every command tells."""
    Path("m.yaml").write_text(IDLE_POINTS)
    done = run("check", "m.yaml", "--json")
    assert done.code == 0
    assert [w["message"] for w in done.json["warnings"] if w["code"] == "unused-name"] == [
        "point `lone` of body `c1` is not used",
        "points `P1` of body `c2`, `P3` of body `c2` are not used",
    ]
    assert done.err.count("unused-name") == 2 and "warning[limits]" in done.err
    grid = ("--grid", "x=140:160:5,y=240:260:5")
    commands = [
        ("simulate", *grid, "--noise", "declared", "-o", "t.csv"), ("sensitivity", *grid), ("observability", *grid),
        ("plan", *grid), ("calibrate", "t.csv"), ("diagnose", "t.csv"), ("effects",),
        ("improve", "t.csv", "--only", "backlash@q1", "-o", "i.yaml"),
    ]  # fmt: skip
    for command, *arguments in commands:
        done = run(command, "m.yaml", *arguments)
        assert done.code in (0, 1), (command, done.err)
        assert "not used" not in done.err + done.out, command
        assert done.err.count("warning[limits]") == (command not in ("plan", "effects")), command


def test_an_entry_that_is_repeated_is_told_once() -> None:
    text = IDLE_POINTS.replace(
        "parameters: {", 'parameters: {"s{i}": {each: {i: [1, 2, 3, 4, 5, 6, 7, 8]}, nominal: 1}, '
    )
    Path("m.yaml").write_text(text)
    done = run("simulate", "m.yaml", "--grid", "x=140:160:4,y=240:260:3")
    assert done.code == 3 and done.err.count("unused-name") == 1
    assert "parameters `s1`, `s2`, `s3`, `s4`, `s5`, `s6` and 2 more are not used" in done.err
