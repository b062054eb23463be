"""Limits on the command line, annotations of files, exit codes: what a pipeline relies on."""

from __future__ import annotations

import re
from collections.abc import Callable, Collection
from pathlib import Path
from urllib.parse import unquote

import pytest
import yaml

from pkmcal_cli.base import errors
from pkmcal_cli.base.annotations import annotation
from pkmcal_cli.commands._group import names
from tests.command import GRID, MACHINES, ROOT, SCISSORS, SHOPFLOOR, TRIGLIDE, TRIGLIDE_DATA, clean, run
from tests.csv_tables import read_table

PAGE = (ROOT / "docs" / "pipelines.md").read_text(encoding="utf-8")
PLAIN, PLAIN_DATA = (str(MACHINES / f"triglide-nonredundant.{end}") for end in ("yaml", "csv"))
QUICK = (PLAIN, PLAIN_DATA, "-q", "--json")


def judged(*limits: str, arguments: tuple[str, ...] = QUICK) -> tuple[int, list[dict[str, object]], str]:
    """Exit code, limits as JSON has them, and stderr, of a calibration with limits."""
    done = clean(run("calibrate", *arguments, *(word for limit in limits for word in ("--fail-above", limit))))
    return done.code, done.json["gates"], done.err


def test_limits_are_held_against_what_the_result_says() -> None:
    done = run("calibrate", *QUICK).json
    l1 = next(p for p in done["parameters"] if p["name"] == "l1")
    figures = {
        "heldout": (1e3 * done["heldout"]["rms_after"], " um"),
        "fitted": (1e3 * done["after"]["position"]["rms"], " um"),
        "chi2": (done["chi2_per_dof"], ""),
        "std:l1": (1e3 * l1["std"], " um"),
    }
    code, kept, _ = judged(*(f"{name} {value * 1.001:.9g}{unit}" for name, (value, unit) in figures.items()))
    assert code == 0 and [k["value"] for k in kept] == pytest.approx([v for v, _ in figures.values()], rel=1e-12)
    code, missed, told = judged(*(f"{name} {value * 0.999:.9g}{unit}" for name, (value, unit) in figures.items()))
    assert code == 1 and not any(m["kept"] for m in missed)
    assert re.findall(r"^(\S+?)(?::\d+:\d+)?: error\[above\]", told, re.MULTILINE) == [PLAIN_DATA] * 3 + [TRIGLIDE]


def test_the_change_is_that_of_the_tool_point_at_the_same_set_values(tmp_path: Path) -> None:
    """Against tables simulated with the parameters before and after."""
    files = {name: tmp_path / f"{name}.csv" for name in ("before", "after")}
    assert run("calibrate", PLAIN, PLAIN_DATA, "-q", "-o", tmp_path / "p.yaml").code == 0
    drives = tmp_path / "drives.csv"
    drives.write_text("\n".join(",".join(line.split(",")[:3]) for line in Path(PLAIN_DATA).read_text().splitlines()))
    assert run("simulate", PLAIN, drives, "-q", "-o", files["before"]).code == 0
    assert run("simulate", PLAIN, drives, "-q", "-p", tmp_path / "p.yaml", "-o", files["after"]).code == 0
    one, other = (read_table(file) for file in files.values())
    apart = max((other.numbers["x"] - one.numbers["x"]) ** 2 + (other.numbers["y"] - one.numbers["y"]) ** 2) ** 0.5
    (change,) = judged("change 1 m")[1]
    assert change["value"] == pytest.approx(1e-3 * apart, rel=1e-6)  # the tables have so many digits
    (none,) = judged("change 1 um", arguments=(*QUICK, "-p", str(tmp_path / "p.yaml")))[1]
    assert none["kept"] and none["value"] == pytest.approx(0, abs=1e-3)  # um: the fit ends where it began


def test_a_turn_of_a_point_without_orientation_is_not_known() -> None:
    """The tool point of the Triglide is a node: a limit in degrees was kept whatever happened."""
    code, (turn, shift), told = judged("change 1 deg", "change 1 m")
    assert code == 1 and turn["value"] is None and not turn["kept"] and shift["kept"]
    assert "largest change of the tool point's orientation: unknown, so the limit of 1 deg is missed" in told


@pytest.mark.parametrize(
    ("limit", "told"),
    [("heldout 0.002 mm", "0.008553 mm, above the limit of 0.002 mm"), ("chi2 3", "144.4, above the limit of 3 ")],
)
def test_a_missed_limit_is_told_in_its_own_unit(limit: str, told: str) -> None:
    done = run("calibrate", SCISSORS, SHOPFLOOR, "-q", "--fail-above", limit)
    assert done.code == 1 and told in done.err


def test_a_limit_that_cannot_be_judged_is_missed() -> None:
    code, (gate,), told = judged("heldout 1 m", arguments=(*QUICK, "--holdout", "none"))
    assert code == 1 and gate["value"] is None and not gate["kept"] and "above the limit" not in told
    assert "heldout (not requested): unknown, so the limit of 1 m is missed" in told and "`--holdout 5`" in told
    code, (gate,), told = judged("std:yb2r 1 m", arguments=(*QUICK, "--select", "l1,l2"))
    assert code == 1 and gate["value"] is None and "standard uncertainty of yb2r: unknown" in told, "not identified"
    one = "id,q1,q2,q3,x,y\np1,116.33,603.67,946.83,360,275\n"
    done = run("calibrate", TRIGLIDE, "-", "--select", "l1,xb1r", "--fail-above", "std:l1 1 m", "-q", stdin=one)
    assert done.code == 1 and "standard uncertainty of l1: unknown" in done.err, "undetermined"


@pytest.mark.parametrize(
    ("limit", "told"),
    [
        ("heldut 20 um", "did you mean `heldout`?"),
        ("heldout", 'such as "heldout 20 um"'),
        ("heldout 20", "has no unit"),
        ("chi2 4 um", "is not a number"),
        ("heldout 20 rad", "nothing is measured in rad"),
        ("heldout 5 N", 'help: give `--fail-above` as "heldout 20 um" (position)'),
        ("heldout:position 20 rad", "no error `position` in rad"),
        ("heldout:orientation 20 rad", "no orientations were measured"),
        ("heldout -20 um", "is negative"),
        ("std 5 um", 'such as "heldout 20 um"'),
        ("std:l9 5 um", "`check` lists all"),
        ("std:l1 5", "`std:l1 5` has no unit"),
        ("std:l1 5 N", "`l1` is not measured in N"),
        ("change:position 5 um", 'such as "heldout 20 um"'),
        ("fitted nan um", "--fail-above"),
        ("fitted 1e999 um", "too large"),
    ],
)
def test_what_is_no_limit_is_refused_before_the_work(limit: str, told: str) -> None:
    done = clean(run("calibrate", *QUICK, "--fail-above", limit))
    assert done.code == 2 and told in done.err and "help:" in done.err


def test_a_largest_rms_is_a_limit_of_held_out_rows_or_else_of_fitted_ones() -> None:
    for more, rows in (((), "held-out"), (("--holdout", "none"), "fitted")):
        done = clean(run("calibrate", *QUICK, *more, "--max-rms", "0.001 mm"))
        assert done.code == 1 and f"position rms of {rows} rows: 0.014" in done.err
        assert done.json["gates"][0]["what"] == f"position rms of {rows} rows"


def commands_of(text: str) -> list[tuple[str, dict[str, str], str]]:
    """Workflow commands in a text, undone as GitHub's runner does: severity, properties, message."""
    out = []
    for severity, properties, message in re.findall(r"^::(\w+)(?: (.*?))?::(.*)$", text, re.MULTILINE):
        pairs = (part.partition("=") for part in properties.split(",") if part)
        out.append((severity, {key: unquote(value) for key, _, value in pairs}, unquote(message)))
    return out


def test_faults_are_annotated_with_file_and_line(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "bad.yaml").write_text("space: planar\nnodes: {a: [0, 0, 0]}\nnodez: {}\n")
    for form in (("--format", "github"), ("--format=github",)):
        for command in (("check", "bad.yaml"), ("calibrate", "bad.yaml", TRIGLIDE_DATA)):
            done = clean(run(*command, *form, "-q"))
            plain = clean(run(*command, "-q"))
            found = commands_of(done.err)
            places = re.findall(r"^bad\.yaml:(\d+):(\d+): error\[([\w-]+)\]", plain.err, re.MULTILINE)
            assert [(p["line"], p["col"], p["title"]) for _, p, _ in found] == places and len(places) >= 2
            assert all(severity == "error" and p["file"] == "bad.yaml" for severity, p, _ in found)
            assert "::error" not in plain.err and done.code == plain.code


def test_rows_that_are_not_used_and_outliers_are_annotated_at_their_lines(tmp_path: Path) -> None:
    lines = Path(TRIGLIDE_DATA).read_text().splitlines()
    cells = lines[10].split(",")
    cells[-1] = str(float(cells[-1]) + 3)
    (tmp_path / "t.csv").write_text("\n".join([*lines[:10], ",".join(cells), *lines[11:], ""]))
    done = clean(run("calibrate", TRIGLIDE, tmp_path / "t.csv", "--format", "github", "--holdout", "none"))
    lines_told = [p.get("line") for severity, p, text in commands_of(done.err) if "outlier: " in text]
    assert "11" in lines_told
    assert not commands_of(run("calibrate", TRIGLIDE, tmp_path / "t.csv", "--holdout", "none").err)


def table_of_triglide(file: Path, change: Callable[[float, float], tuple[float, float]], rows: Collection[int]) -> str:
    """The table of the Triglide without redundancy; change: readings (x, y), mm, of rows at these lines of the file."""
    lines = Path(PLAIN_DATA).read_text().splitlines()
    for line in rows:
        *rest, x, y = lines[line - 1].split(",")
        lines[line - 1] = ",".join([*rest, *(f"{v:.6f}" for v in change(float(x), float(y)))])
    file.write_text("\n".join(lines) + "\n")
    return str(file)


@pytest.mark.parametrize("command", ["calibrate", "diagnose", "improve"])
def test_a_negative_verdict_is_an_annotation_of_the_table_and_is_told_when_quiet(command: str, tmp_path: Path) -> None:
    """A tracker that moved by 3 mm half way: no fit is to be believed. `improve -q` failed without a word."""
    last = len(Path(PLAIN_DATA).read_text().splitlines())
    table = table_of_triglide(tmp_path / "t.csv", lambda x, y: (x + 3 * (y > 270), y), range(2, last + 1))
    for quiet in ((), ("-q",)):
        done = clean(run(command, PLAIN, table, "--format", "github", *quiet))
        errors_told = [(p.get("file"), text) for severity, p, text in commands_of(done.err) if severity == "error"]
        assert done.code == 1 and len(errors_told) == 1 and errors_told[0][0] == table
        verdict = errors_told[0][1].splitlines()[0]
        assert verdict.startswith(("IMPLAUSIBLE", "diagnosis: ", "NOT IMPROVED")) and done.err.count(verdict) == 2
    assert not any(severity == "warning" for severity, _, _ in commands_of(done.err))


def test_rows_that_a_search_does_not_use_are_annotated_at_their_lines(tmp_path: Path) -> None:
    table = table_of_triglide(tmp_path / "t.csv", lambda x, y: (x + 2, y), (30, 50))
    told = commands_of(clean(run("diagnose", PLAIN, table, "--format", "github")).err)
    rows = [(p["file"], p["line"]) for severity, p, text in told if severity == "warning" and "bad row: " in text]
    assert rows == [(table, "30"), (table, "50")]


def test_doubts_of_a_table_and_of_a_parameter_have_a_file(tmp_path: Path) -> None:
    """A reading that never changes, at the table; values far off nominal, at the first one in the machine file."""
    last = len(Path(PLAIN_DATA).read_text().splitlines())
    stuck = table_of_triglide(tmp_path / "y.csv", lambda x, y: (x, 275.0), range(2, last + 1))
    for command, severity in (("check", "error"), ("calibrate", "warning")):
        told = commands_of(clean(run(command, PLAIN, stuck, "--format", "github")).err)
        assert [p.get("file") for s, p, text in told if s == severity and "repeats" in text] == [stuck]
    moved = table_of_triglide(tmp_path / "x.csv", lambda x, y: (x + 3 * (y > 270), y), range(2, last + 1))
    told = commands_of(clean(run("calibrate", PLAIN, moved, "--format", "github")).err)
    (place,) = [p for _, p, text in told if text.startswith("far from nominal")]
    assert (place["file"], "l1:" in Path(TRIGLIDE).read_text().splitlines()[int(place["line"]) - 1]) == (TRIGLIDE, True)


def test_annotations_keep_their_line_and_their_parts() -> None:
    text = annotation("error", "50 % of\nrows, two: lines\r", errors.Location("a:b,c.yaml", 3), "x")
    assert "\n" not in text and commands_of(text) == [
        ("error", {"file": "a:b,c.yaml", "line": "3", "title": "x"}, "50 % of\nrows, two: lines\r")
    ]


def test_a_format_that_is_none_is_refused() -> None:
    done = clean(run("check", TRIGLIDE, "--format", "githb"))
    assert done.code == 2 and "did you mean `github`?" in done.err


def test_the_table_of_exit_codes_is_that_of_the_program() -> None:
    codes = {int(code) for code in re.findall(r"^\| (\d+) \|", PAGE, re.MULTILINE)}
    declared = {kind.exit_code for kind in (errors.UsageError, errors.BadInput, errors.OutputError, errors.PkmcalError)}
    assert codes == declared | {0, 1, 130}
    rows = re.findall(r"^\| (`[^|]+) \| [^|]+ \|$", PAGE.partition("| command |")[2].partition("## Limits")[0], re.M)
    assert sorted(re.findall(r"`(\w+)`", " ".join(rows))) == sorted(names())


def test_the_workflow_of_the_page_calls_commands_with_their_options(monkeypatch: pytest.MonkeyPatch) -> None:
    (text,) = re.findall(r"```yml\n(.*?)```", PAGE, re.DOTALL)
    steps = [step["run"] for step in yaml.safe_load(text)["jobs"]["machine"]["steps"] if "run" in step]
    for line in (step for step in steps if step.startswith("pkmcal")):
        words = run(line.split()[1], "--help").out
        assert set(re.findall(r"--[\w-]+", line)) <= set(re.findall(r"--[\w-]+", words)), line


def test_points_of_grids_and_rows_of_tables_end_as_the_table_says(tmp_path: Path) -> None:
    (tmp_path / "far.csv").write_text("id,x,y\np1,360,275\np2,9999,275\n")
    for command in ("simulate", "correct"):
        assert run(command, PLAIN, tmp_path / "far.csv", "-o", tmp_path / "o.csv", "--force").code == 1
        assert run(command, PLAIN, "--grid", f"{GRID}", "-o", tmp_path / "o.csv", "--force").code == 0
    one = ("observability", PLAIN, "--grid", "x=400:400:1,y=250:250:1", "--select")
    assert [run(*one, names).code for names in ("auto", "l1,l2,xb1r")] == [0, 1]
