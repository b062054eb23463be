"""Odd inputs of every kind: never a traceback, never exit 0 on failure, never a NaN on stdout."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from hypothesis import HealthCheck, example, given, settings
from hypothesis import strategies as st

from tests.command import TRIGLIDE, Done, clean, run
from tests.in_ci import in_ci
from tests.odd_machines import MACHINES, TABLES

COMMANDS = (
    ("check",),
    ("simulate",),
    ("sensitivity",),
    ("observability",),
    ("calibrate",),
    ("calibrate", "--select", "all", "--holdout", "2"),
)


LONG = (
    "ropes", "force-column", "force-constant", "all-fixed", "no-parameters", "limits",
    "huge drive", "drives far", "far", "unicode", "measured",
)  # fmt: skip
"""Machines and tables whose fits take long."""


@pytest.fixture(autouse=True)
def _folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)


def looked_at(done: Done, as_json: bool) -> Done:
    """The result of a command on odd input: what it may do, and what not."""
    clean(done)
    assert done.code in (0, 1, 2, 3)
    if as_json and done.code in (0, 1):
        assert isinstance(done.json, dict)
    elif as_json:
        assert done.out == ""
    return done


@pytest.mark.parametrize("machine", in_ci([m for m in MACHINES if m not in LONG], MACHINES))
def test_every_command_on_odd_machines_and_tables(machine: str) -> None:
    """All commands, on the tables in turn, so that every pair of a machine and a table is met by some command."""
    Path("m.yaml").write_text(MACHINES[machine])
    start = list(MACHINES).index(machine)
    for k, (name, text) in enumerate(TABLES.items()):
        Path("t.csv").write_text(text)
        command, *more = COMMANDS[(start + k) % len(COMMANDS)]
        target = ["-o", "out.csv", "--force"] if command == "simulate" else []
        looked_at(run(command, "m.yaml", "t.csv", *more, *target, "--json"), True)
        assert name


@pytest.mark.parametrize("table", in_ci([t for t in TABLES if t not in LONG], TABLES))
def test_every_command_on_an_ordinary_machine_and_odd_tables(table: str) -> None:
    Path("m.yaml").write_text(MACHINES["base"])
    Path("t.csv").write_text(TABLES[table])
    for command, *more in COMMANDS:
        looked_at(run(command, "m.yaml", "t.csv", *more), False)


@pytest.mark.parametrize("command", ["check", "simulate", "sensitivity", "observability", "calibrate"])
def test_files_that_are_none(command: str) -> None:
    Path("folder").mkdir()
    Path("t.csv").write_text(TABLES["measured"])
    for machine in ("nope.yaml", "folder", "", "x" * 5000, "nope/nope.yaml", "/dev/null"):
        expected = 1 if (command, machine) == ("check", "/dev/null") else 3
        assert clean(run(command, machine, "t.csv")).code == expected
    for table in ("nope.csv", "folder", "", "x" * 5000, "/dev/null"):
        expected = 1 if (command, table) == ("check", "/dev/null") else 3
        assert clean(run(command, TRIGLIDE, table)).code == expected


@pytest.mark.parametrize("target", ["folder", "nope/out", "/proc/out", "", "x" * 300, "there.yaml/out"])
def test_outputs_that_cannot_be_written(target: str) -> None:
    Path("folder").mkdir()
    Path("there.yaml").write_text("")
    Path("t.csv").write_text(TABLES["measured"])
    for command in (["simulate", TRIGLIDE, "t.csv"], ["calibrate", TRIGLIDE, "t.csv", "--select", "l1,l2"], ["schema"]):
        done = clean(run(*command, "-o", target))
        assert done.code == 4 and "error[output]" in done.err and done.out == ""


def test_a_folder_without_rights_is_told(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("pkmcal_cli.base.files.os.access", lambda *_: False)
    done = run("schema", "-o", "out.json")
    assert done.code == 4 and "the folder is not writable" in done.err


def test_a_disk_that_runs_full_leaves_nothing(monkeypatch: pytest.MonkeyPatch) -> None:
    def full(_: int) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr("pkmcal_cli.base.files.os.fsync", full)
    done = run("schema", "-o", "out.json")
    assert done.code == 4 and "No space left on device" in done.err
    assert list(Path().iterdir()) == []


@pytest.mark.parametrize(
    ("grid", "told"),
    [
        ("", "`` is not an axis"),
        ("x", "`x` is not an axis"),
        ("x=1:2", "`x=1:2` is not an axis"),
        ("x=1:2:3:4", "is not an axis"),
        ("x=1:2:0", "`0` is not a number of poses"),
        ("x=1:2:-3", "`-3` is not a number of poses"),
        ("x=1:2:2.5", "`2.5` is not a number of poses"),
        ("x=1:2:" + "9" * 5000, "is not a number of poses"),
        ("x=1:2:²", "`²` is not a number of poses"),
        ("x=nan:2:3", "`nan` is not a number"),
        ("x=1:inf:3", "`inf` is not a number"),
        ("x=1:1e999:3", "`1e999` is not a limit"),
        ("x=1 deg:2:3", "`1 deg` is not a limit"),
        ("x=1:2:9999999999", "more than 1000000000 poses"),
        ("x=1:2:100000,y=1:2:100000", "more than 1000000000 poses"),
        ("x=1:2:3,x=1:2:3", "`x` is given twice"),
        ("z=1:2:3", "`z` is not a coordinate of the tool point"),
        ("q1=1:2:3", "`q1` is not a coordinate of the tool point"),
        ("rz=0:1:2", "tool point `tcp` is a node without rotation: it has no `rz`"),
        ("x=300:300:1,", "`` is not an axis"),
    ],
)
def test_grids_that_mean_nothing(grid: str, told: str) -> None:
    for command in ("simulate", "sensitivity"):
        done = run(command, TRIGLIDE, "--grid", grid)
        assert done.code == 2 and told in done.err and done.err.splitlines()[-1].startswith("help: ")


def test_an_analysis_takes_a_million_positions_at_most() -> None:
    done = run("sensitivity", TRIGLIDE, "--grid", "x=0:1:1001,y=0:1:1000")
    assert done.code == 2 and "more than 1000000 poses" in done.err


def test_poses_are_given_once() -> None:
    Path("t.csv").write_text(TABLES["poses"])
    assert run("simulate", TRIGLIDE).code == 2
    for command in ("simulate", "sensitivity", "observability"):
        assert run(command, TRIGLIDE, "t.csv", "--grid", "x=300:300:1").code == 2


@pytest.mark.parametrize("seed", ["-1", "x", "1.5", ""])
def test_seeds_that_are_none(seed: str) -> None:
    assert run("simulate", TRIGLIDE, "--grid", "x=300:300:1", f"--seed={seed}").code == 2


@pytest.mark.parametrize("noise", ["10", "-1 um", "1e999 um", "1 deg", "nope", "", "nan um", "10 furlong"])
def test_noise_that_is_none(noise: str) -> None:
    done = run("simulate", TRIGLIDE, "--grid", "x=300:300:1", "--noise", noise)
    assert done.code == 2 and "--noise" in done.err


@pytest.mark.parametrize("limit", ["5", "5 deg", "-5 um", "abc", "1e999 m", ""])
def test_limits_that_are_none(limit: str) -> None:
    Path("t.csv").write_text(TABLES["measured"])
    done = run("calibrate", TRIGLIDE, "t.csv", "--max-rms", limit)
    assert done.code == 2 and "--max-rms" in done.err


def test_the_same_file_twice() -> None:
    Path("t.csv").write_text(TABLES["measured"])
    done = run("calibrate", TRIGLIDE, "t.csv", "t.csv")
    assert done.code == 3 and "this file is given twice" in done.err
    assert run("calibrate", TRIGLIDE, "-", "-", stdin="").code == 2


NUMBER = st.one_of(
    st.integers(-(10**6), 10**6).map(str),
    st.floats().map(str),
    st.sampled_from(["", "1e400", "0x10", "1_000", "-0", "+5", ".", "5.", ".5", "1 m", "2 deg", "3 furlong"]),
)
COUNT = st.one_of(st.integers(-3, 40).map(str), st.sampled_from(["", "1e3", "2.0", "٣", "0x2", " 2 ", "99999999999"]))
NAME = st.sampled_from(["x", "y", "rz", "z", "q1", "", "X", "x y", "=", "x=", "é"])
AXIS = st.builds("{}={}:{}:{}".format, NAME, NUMBER, NUMBER, COUNT)
TEXT = st.text(st.characters(codec="utf-8", exclude_characters="\0"), max_size=20)
ODD = settings(max_examples=20, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])


@ODD
@given(st.one_of(st.lists(AXIS, max_size=3).map(",".join), TEXT))
@example("x=0:0:1,y=0:0:1")
@example("x=1e308:-1e308:3")
def test_any_grid(grid: str) -> None:
    done = run("simulate", TRIGLIDE, f"--grid={grid}", "-q")
    looked_at(done, False)
    assert done.code != 3 or "--grid: error[grid]: none of " in done.err


@ODD
@given(
    st.one_of(
        st.lists(st.sampled_from(["auto", "all", "l1", "-l1", "l*", "k?", "-*", "[", "", " ", "gamma"])).map(",".join),
        TEXT,
    )
)
def test_any_selection(select: str) -> None:
    assert looked_at(run("sensitivity", TRIGLIDE, f"--select={select}", "--json", "-q"), True).code in (0, 2)


@ODD
@given(
    st.one_of(NUMBER, st.builds("{} {}".format, NUMBER, st.sampled_from(["um", "mm", "deg", "N", "m^2", "/"])), TEXT)
)
@example("0 um")
@example("1e300 m")
def test_any_noise(noise: str) -> None:
    done = looked_at(run("simulate", TRIGLIDE, "--grid", "x=300:310:2", f"--noise={noise}", "-q"), False)
    assert done.code in (0, 2)
    rows = [line for line in done.out.splitlines() if not line.startswith("#")]
    assert not any(word in line for line in rows for word in ("nan", "inf"))


@ODD
@given(st.one_of(st.builds("{}={}".format, st.sampled_from(["q1", "q2", "q9", "", "x"]), NUMBER), TEXT))
@example("q1=1e300")
@example("q1=500 mm")
def test_any_offset(offset: str) -> None:
    done = run("sensitivity", TRIGLIDE, f"--offset={offset}", "--json", "-q")
    looked_at(done, True)


@pytest.mark.slow
@settings(ODD, max_examples=3)
@given(st.one_of(NUMBER, TEXT))
def test_any_holdout_and_limit(text: str) -> None:
    Path("t.csv").write_text(TABLES["measured"])
    looked_at(run("calibrate", TRIGLIDE, "t.csv", f"--holdout={text}", "--select=l1", "--json"), True)
    looked_at(run("calibrate", TRIGLIDE, "t.csv", f"--max-rms={text}", "--select=l1", "--json"), True)


@ODD
@given(st.recursive(st.one_of(st.none(), st.booleans(), st.integers(), st.floats(), TEXT),
                    lambda inner: st.one_of(st.lists(inner, max_size=3), st.dictionaries(TEXT, inner, max_size=3)),
                    max_leaves=8))  # fmt: skip
def test_any_parameter_file(content: object) -> None:
    Path("p.yaml").write_text("parameters:\n  l1: " + json.dumps(content) + "\n")
    assert looked_at(run("sensitivity", TRIGLIDE, "-p", "p.yaml", "--json"), True).code in (0, 3)


@ODD
@given(st.binary(max_size=60))
def test_any_bytes_as_a_file(content: bytes) -> None:
    Path("b").write_bytes(content)
    for arguments in (
        ["check", "b"],
        ["check", TRIGLIDE, "b"],
        ["simulate", TRIGLIDE, "b"],
        ["sensitivity", TRIGLIDE, "-p", "b"],
    ):
        assert looked_at(run(*arguments), False).code != 0
