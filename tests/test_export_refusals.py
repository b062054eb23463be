"""`correct --as`: what cannot be written is told before anything is, and other output stays as it was."""

from __future__ import annotations

from pathlib import Path

import pytest

from pkmcal_cli.correction.formats import formats
from tests.command import HANGPRINTER, MACHINES, SCISSORS, TRIGLIDE, run
from tests.in_ci import in_ci

BIGLIDE = str(MACHINES / "biglide.yaml")
DELTA = str(MACHINES / "delta-printer.yaml")
GRIDS = {
    BIGLIDE: "x=250:450:3,y=220:320:3",
    TRIGLIDE: "x=300:400:3,y=200:300:3",
    SCISSORS: "x=-50:50:3,y=-50:50:3",
    DELTA: "x=-50:50:3,y=-50:50:3,z=0:50:2",
    HANGPRINTER: "x=-50:50:3,y=-50:50:3,z=0:50:2",
    str(MACHINES / "hexapod7.yaml"): "x=-30:30:2,y=-30:30:2",
    str(MACHINES / "belt-router.yaml"): "x=1000:2000:3,y=800:1400:3",
    str(MACHINES / "delta4.yaml"): "x=-30:30:2,y=-30:30:2",
}


CRANKS = """
units: {length: mm, angle: deg}
space: planar
ground: {O1: [0, 0], O2: [300, 0], O3: [150, 620]}
nodes: {tip: [150, 320]}
bodies:
  arm1: {at: [0, 0], turn: 111.4, points: {E1: [200, 0]}}
  arm2: {at: [300, 0], turn: 68.6, points: {E2: [200, 0]}}
  arm3: {at: [150, 620], turn: -148.7, points: {E3: [200, 0]}}
joints: {"hub{i}": {each: {i: [1, 2, 3]}, between: ["O{i}", "arm{i}"], type: revolute}}
bars: {"rod{i}": {each: {i: [1, 2, 3]}, between: ["E{i}", tip], length: 260, k: 4 N/um}}
actuators: {"q{i}": {each: {i: [1, 2]}, turns: "arm{i}"}, q3: {turns: arm3, redundant: true}}
sensors: {camera: {at: tip, reads: [x, y], sigma: 3 um, frame: machine}}
tool_point: tip
"""
TWO_LINES = """
units: {length: mm, angle: deg}
space: planar
gravity: [0, -9.81]
ground: {A: [0, 1000], B: [1000, 1000]}
nodes: {tip: {at: [500, 500], mass: 2 kg}}
ropes: {"line{i}": {each: {i: [A, B]}, between: ["{i}", tip], EA: 20 kN}}
actuators: {"q{i}": {each: {i: [A, B]}, winds: "line{i}"}}
sensors: {camera: {at: tip, reads: [x, y], sigma: 3 um, frame: machine}}
tool_point: tip
"""
FOUR_CRANKS = (
    CRANKS.replace("O3: [", "O4: [600, 320], O3: [")
    .replace("\njoints", "\n  arm4: {at: [600, 320], turn: 166.33, points: {E4: [200, 0]}}\njoints")
    .replace("[1, 2, 3]", "[1, 2, 3, 4]")
    .replace("q3: {turns: arm3", "q4: {turns: arm4, redundant: true}, q3: {turns: arm3")
)


@pytest.fixture(autouse=True)
def _folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)


def test_the_help_lists_every_format() -> None:
    told = " ".join(run("correct", "--help").out.split()).replace("- ", "-")
    assert ", ".join(formats()) in told
    page = (MACHINES.parent / "docs" / "correct.md").read_text()
    assert [name for name in formats() if f"| `{name}` |" not in page] == []


def test_every_format_cites_its_specification() -> None:
    """But for the list of shims, which is for people."""
    silent = [name for name, about in formats().items() if not about.sources]
    assert silent == ["adjust"]
    assert all(s.startswith("https://") for about in formats().values() for s in about.sources)


@pytest.mark.parametrize(
    "machine",
    in_ci(["triglide", "scissors", "delta-printer", "belt-router", "delta4"], GRIDS, lambda file: Path(file).stem),
)
@pytest.mark.parametrize("keyword", ["klipper", "reprapfirmware", "gcode", "gcode-drives", "adjust"])
def test_a_format_fits_or_says_why_not(machine: str, keyword: str) -> None:
    """No file where it does not, and what to use instead."""
    done = run("correct", machine, "--grid", GRIDS[machine], "--as", keyword, "-o", "out.txt")
    if done.code == 0:
        assert Path("out.txt").stat().st_size > 100
        return
    assert done.code == 3 and f"error[format]: --as {keyword}: " in done.err and "help: " in done.err
    assert not Path("out.txt").exists()


def test_switches_are_asked_for_only_where_they_would_do() -> None:
    """A Triglide is no delta, whatever its limits."""
    never = run("correct", TRIGLIDE, "--grid", GRIDS[TRIGLIDE], "--as", "klipper", "-o", "out.txt")
    assert never.code == 3 and "no linear delta" in never.err and "switch" not in never.err
    lacking = run("correct", DELTA, "--grid", GRIDS[DELTA], "--as", "klipper", "-o", "out.txt")
    assert lacking.code == 3 and "where the switch of `" in lacking.err and "add `limits: " in lacking.err


def test_a_machine_that_is_none_of_the_firmware_is_told_which_are() -> None:
    """Whatever else its file lacks for one that is, such as switches."""
    for machine in (TRIGLIDE, SCISSORS):
        done = run("correct", machine, "--grid", GRIDS[machine], "--as", "klipper", "-o", "out.txt")
        assert "`kinematics: delta`" in done.err and "`winch`" in done.err and "--as gcode-drives" in done.err
    Path("cranks.yaml").write_text(CRANKS)
    done = run("correct", "cranks.yaml", "--grid", "x=120:180:3,y=290:350:3", "--as", "klipper", "-o", "out.txt")
    assert "this machine is no linear delta" in done.err and "switch" not in done.err


@pytest.mark.parametrize("keyword", ["klipper", "reprapfirmware", "gcode", "gcode-drives", "gcode-printer"])
def test_what_is_advised_is_possible(keyword: str) -> None:
    """Four cranks have no program, which is told before the work; tables of single drives do."""
    Path("cranks.yaml").write_text(FOUR_CRANKS)
    grid = ("--grid", "x=120:180:3,y=290:350:3")
    done = run("correct", "cranks.yaml", *grid, "--as", keyword, "-o", "out.txt")
    assert done.code == 3 and done.err.startswith("cranks.yaml: error[format]"), "nothing is shown before"
    remedy = done.err[done.err.index("help: ") :]
    assert "without `--as`" in remedy and "gcode-drives" not in remedy
    for advised in ("linuxcnc", "beckhoff", "csv"):
        assert f"`{advised}`" in remedy or f"`--as {advised}`" in remedy
        assert run("correct", "cranks.yaml", *grid, "--as", advised, "-o", f"{advised}.csv").code == 0
    if keyword == "gcode-drives":
        assert "4 rotary drives, but G-code has 3 words for rotary axes (A B C)" in done.err
        planned = run("plan", "cranks.yaml", *grid, "--as", "gcode", "-o", "out.ngc")
        assert planned.code == 3 and planned.err.startswith("cranks.yaml: error[format]: --as gcode: 4 rotary drives")


def test_of_two_firmwares_neither_advises_one_that_refuses() -> None:
    """Two lines are too few for either."""
    Path("lines.yaml").write_text(TWO_LINES)
    for keyword in ("klipper", "reprapfirmware"):
        done = run("correct", "lines.yaml", "--grid", "x=400:600:2,y=400:500:2", "--as", keyword, "-o", "out.txt")
        assert done.code == 3 and "this machine 2 drives" in done.err
        assert "`--as klipper`" not in done.err and "`--as gcode-drives`" in done.err


@pytest.mark.parametrize(
    ("options", "code", "told"),
    [
        (["--as", "linuxnc"], 2, "did you mean `linuxcnc`?"),
        (["--as", "haas"], 2, "adjust, beckhoff, csv"),
        (["--as", "linuxcnc"], 2, "a file for every drive"),
        (["--as", "linuxcnc", "-o", "-"], 2, "a file for every drive"),
        (["--as", "linuxcnc", "-o", ""], 2, "a file for every drive"),
        (["--as", "linuxcnc", "-o", ".."], 2, "a file for every drive"),
        (["--as", "linuxcnc", "-o", "/dev/null"], 2, "a file for every drive"),
        (["--as", "linuxcnc", "-o", "x" * 300], 4, "xxx"),
        (["--as", "linuxcnc", "-o", "no/such/t.comp"], 4, "no/such"),
        (["--as", "csv", "--json"], 2, "both write to stdout"),
        (["--as", "gcode", "--dwell", "0"], 2, "--dwell"),
        (["--as", "gcode", "--feed", "-1"], 2, "--feed"),
        (["--as", "gcode", "--feed", "nan"], 2, "--feed"),
        (["--as", "gcode", "--dwell", "x"], 2, "--dwell"),
    ],
)
def test_options_that_do_not_go(options: list[str], code: int, told: str) -> None:
    done = run("correct", BIGLIDE, "--grid", GRIDS[BIGLIDE], *options)
    assert done.code == code and told in done.err


def test_all_files_or_none() -> None:
    """A file that is there is not replaced, nor are its neighbours written."""
    Path("t.q2.comp").write_text("mine")
    options = ["--grid", GRIDS[BIGLIDE], "--as", "linuxcnc", "-o", "t.comp"]
    done = run("correct", BIGLIDE, *options)
    assert done.code == 4 and "t.q2.comp" in done.err
    assert sorted(p.name for p in Path().iterdir()) == ["t.q2.comp"] and Path("t.q2.comp").read_text() == "mine"
    assert run("correct", BIGLIDE, *options, "--force").code == 0 and len(list(Path().iterdir())) == 3


def test_an_input_is_never_replaced() -> None:
    Path("t.X.comp").write_text(Path(BIGLIDE).read_text().replace("q1:", "X:"))
    done = run("correct", "t.X.comp", "--grid", GRIDS[BIGLIDE], "--as", "linuxcnc", "-o", "t.comp", "--force")
    assert done.code == 4 and "input of the command" in done.err


def test_without_targets_nothing_is_written() -> None:
    Path("far.csv").write_text("x,y\n500,9000\n")
    done = run("correct", BIGLIDE, "far.csv", "--as", "csv", "-o", "t.csv")
    assert done.code == 1 and not Path("t.csv").exists()


def test_the_export_goes_to_stdout_too() -> None:
    done = run("correct", BIGLIDE, "--grid", GRIDS[BIGLIDE], "--as", "csv", "-q")
    assert done.code == 0 and done.out.startswith("# pkmcal correct --as csv") and done.err == ""
    assert "drive,unit,position,forward,reverse\nq1,mm," in done.out


def test_the_table_is_as_before_without_a_format() -> None:
    done = run("correct", BIGLIDE, "--grid", GRIDS[BIGLIDE], "-o", "c.csv", "--json")
    assert done.code == 0 and "export" not in done.json
    assert "remains" not in done.err and "--as" not in Path("c.csv").read_text().splitlines()[0]
