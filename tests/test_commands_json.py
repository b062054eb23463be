"""The JSON interface: docs/json.md says what is there, no more and no less."""

from __future__ import annotations

import contextlib
import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from tests.command import (
    GRID,
    HANGPRINTER,
    HANGPRINTER_DATA,
    MACHINES,
    ROOT,
    SCISSORS,
    SHOPFLOOR,
    TRIGLIDE,
    run,
)
from tests.json_schemas import faults_of
from tests.odd_campaigns import growing_noise, odd_field, odd_shape
from tests.test_far_causes import router
from tests.test_plausible import MACHINE as SPOILT
from tests.test_plausible import spoilt, turned
from tests.test_slack_ropes import text, wound

PLAIN = str(MACHINES / "triglide-nonredundant.yaml")
PLAIN_DATA = str(MACHINES / "triglide-nonredundant.csv")

# maps whose keys are names, with the word that stands for them
NAMED = {
    "unexplained[].hidden": "PARAMETER",
    "provenance.inputs": "FILE", "before": "KIND", "after": "KIND", "heldout.before": "KIND",
    "heldout.after": "KIND", "channels_before": "CHANNEL", "channels_after": "CHANNEL",
    "points[]": "COLUMN", "steps[].fit": "KIND", "steps[].choose": "KIND", "steps[].report": "KIND",
    "loads.slack.ropes": "ROPE", "export.loads.slack.ropes": "ROPE", "uncertainty.noise": "INSTRUMENT",
    "uncertainty.ranges.factors": "KIND", "uncertainty.overstated": "CHANNEL",
    "constants": "NAME", "errors": "KIND", "not_held": "COORDINATE", "export.remaining": "KIND", "outside": "COLUMN",
    "outside_values": "COLUMN", "unexplained": "KIND",
    "effects[].far_off": "NAME", "effects[].worst.direction": "NAME", "detectable[].worst.direction": "NAME",
    "invisible[].worst.direction": "NAME", "undetermined[].parameters": "NAME",
    "undetermined[].determined[].coefficients": "NAME", "tool_point.at": "AXIS",
    "errors.as_built": "KIND", "errors.calibrated": "KIND", "errors.held_out": "KIND", "errors.with_causes": "KIND",
    "acceptance.axes[].at": "AXIS", "acceptance.poses[].at": "AXIS", "acceptance.predicted[].at": "AXIS",
}  # fmt: skip


def documented() -> dict[str, set[str]]:
    """Keys by command, with those of every output."""
    out: dict[str, set[str]] = {}
    for section in (ROOT / "docs" / "json.md").read_text().split("\n## ")[1:]:
        out[section.split("\n")[0]] = set(re.findall(r"^\| `([^`]+)` \|", section, flags=re.MULTILINE))
    every = out.pop("In every output")
    return {command: keys | every for command, keys in out.items()}


def paths(value: Any, path: str = "") -> Iterator[str]:
    """Paths of all leaves; an empty list or map is a leaf where nothing says more."""
    if isinstance(value, dict):
        for key, child in value.items():
            name = NAMED.get(path, key)
            yield from paths(child, f"{path}.{name}" if path else name)
    elif isinstance(value, list):
        for child in value:
            yield from paths(child, f"{path}[]")
        if not value:
            yield f"{path}[]"
    else:
        yield path


def covers(path: str, known: set[str]) -> bool:
    """Whether a path is documented; null and empty lists may stand for something that has parts."""
    return path in known or any(k.startswith((f"{path}.", f"{path}[")) for k in known)


def one_lost(text: str, column: int) -> str:
    """A table with the drive of a column (from 0) a metre off in its tenth row."""
    lines = text.splitlines()
    cells = lines[10].split(",")
    cells[column] = str(float(cells[column]) + 1000)
    return "\n".join([*lines[:10], ",".join(cells), *lines[11:], ""])


def write_ropes(folder: Path) -> None:
    """A machine with ropes that go slack and limits that are passed, its table of lengths, and readings."""
    limits = (
        text((4, 5))
        .replace("winds: rope1,", "winds: rope1, force_limit: 10,")
        .replace(", EA: EA", ", EA: EA, t_min: 5")
    )
    (folder / "ropes.yaml").write_text(limits)
    lines = [",".join(f"{1e3 * v:.6f}" for v in row) for row in wound(1)[1]]
    (folder / "lengths.csv").write_text("\n".join([",".join(f"q{i}" for i in range(1, 6)), *lines]))
    assert run("simulate", "ropes.yaml", "lengths.csv", "-o", "ropes.csv", "-q", "--force").code == 0


def write_gap(folder: Path) -> None:
    """A machine that does not close as drawn."""
    gap = Path(TRIGLIDE).read_text().replace("nominal: 50000, range", "nominal: 5e9, range", 1)
    gap = gap.replace("nodes: {", "ground: {a: [0, 0], b: [400, 0], c: [200, -300]}\nnodes: {top: [200, 600], ")
    braces = "\n".join(
        f"  brace{c}: {{between: [{c}, top], k: k1, length: {n}}}" for c, n in zip("abc", (632, 632, 900), strict=True)
    )
    (folder / "gap.yaml").write_text(gap.replace("bars:", f"bars:\n{braces}"))


def write_wrong(folder: Path) -> None:
    """A machine with a wrong bench reading, one with a sigma far too large, and a table with a row that is far off."""
    gauge = "gauge: {kind: bench, of: l1, reading: 300.5, sigma: 5 um}"
    for name, sensors in (("gauge", gauge), ("coarse", "tracker: {sigma: 0.3 mm}")):
        (folder / f"{name}.yaml").write_text(f"extends: {PLAIN}\nsensors: {{{sensors}}}\n")
    lines = Path(PLAIN_DATA).read_text().splitlines()
    cells = lines[10].split(",")
    cells[-1] = str(float(cells[-1]) + 0.3)
    (folder / "row.csv").write_text("\n".join([*lines[:10], ",".join(cells), *lines[11:], ""]))


@pytest.fixture(scope="module")
def written(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Machines, tables and parameter files of all these runs, made once."""
    folder = tmp_path_factory.mktemp("written")
    with contextlib.chdir(folder):
        write_all(folder)
    return folder


def write_all(folder: Path) -> None:
    """Machines, tables and parameter files of these runs."""
    (folder / "free.yaml").write_text(FREE)
    (folder / "blind.yaml").write_text(f"extends: {PLAIN}\nsensors: {{tracker: null}}\n")
    (folder / "one.csv").write_text("id,q1,q2,x,y\np1,116.33,603.67,360,275\n")
    (folder / "far.csv").write_text("id,x,y\np1,360,275\np2,9999,275\n")
    (folder / "shims.yaml").write_text(f"extends: {PLAIN}\nparameters: {{yb1r: {{adjustable: true}}}}\n")
    (folder / "bad.yaml").write_text("space: planar\nnodes: {a: [0, 0, 0]}\n")
    write_gap(folder)
    spoilt(folder, turned)
    head, *lines = Path(PLAIN_DATA).read_text().splitlines()
    (folder / "repeated.csv").write_text("\n".join([head, *lines, *(f"{line}1" for line in lines)]))
    dates = ("time", *(f"2026-05-{day + 1:02d}" for day in range(28)))
    rows = zip(dates, [head, *lines], strict=False)
    (folder / "dated.csv").write_text("\n".join(f"{date},{line}" for date, line in rows))
    for name, table, column in (("lost", PLAIN_DATA, 1), ("shop", SHOPFLOOR, 7)):
        (folder / f"{name}.csv").write_text(one_lost(Path(table).read_text(), column))
    for machine, table, name in ((PLAIN, PLAIN_DATA, "p.yaml"), (SCISSORS, SHOPFLOOR, "shop.params.yaml")):
        assert run("calibrate", machine, table, "-o", folder / name, "-q", "--force", *WHOLE).code == 0
    write_ropes(folder)
    write_wrong(folder)
    (folder / "apart.yaml").write_text(f"extends: {PLAIN}\nsensors: {{tracker: {{frame: fitted}}}}\n")
    (folder / "scaled.yaml").write_text(f"extends: {PLAIN}\neffects: {{scale@q1: {{s: {{identify: true}}}}}}\n")
    for name in ("apart", "scaled"):
        options = ("-o", folder / f"{name}.params.yaml", "-q", "--force", "--run", folder / "runs", *WHOLE)
        assert run("calibrate", folder / f"{name}.yaml", PLAIN_DATA, *options).code == 0


APART, WHOLE = "apart.params.yaml", ("--holdout", "none")


def commands() -> dict[str, list[list[str]]]:
    """Runs that together show every key."""
    accepted = [str(SPOILT), "m.csv", "--holdout", "none", "--starts", "1", "--accept"]
    pin, belts, partly = MACHINES / "delta4.yaml", MACHINES / "belt-router", ("--grid", "x=300:300:1,y=250:2500:2")
    return {
        "check": [
            ["bad.yaml"], ["gap.yaml", "one.csv"], ["gap.yaml", "far.csv"], [str(pin)], ["free.yaml"], ["blind.yaml"],
            [PLAIN, "lost.csv", "-p", "p.yaml", "--tolerance", "20 um"], ["apart.yaml", PLAIN_DATA, "-p", APART],
        ],
        "simulate": [
            [PLAIN, "far.csv", "-o", "out.csv"],
            [PLAIN, "--grid", "x=300:400:2", "-p", "p.yaml", "--uncertainty", "-o", "map.csv"],
            ["ropes.yaml", "lengths.csv", "-o", "slack.csv"], [PLAIN, "far.csv", "--method", "rigid", "-o", "1.csv"],
        ],
        "draw": [[PLAIN, "far.csv"]], "new": [
            ["--from", str(MACHINES / "printer.cfg"), "-o", "new.yaml"], ["delta", "-o", "delta.yaml"]],
        "correct": [
            [PLAIN, "far.csv", "-p", "p.yaml", "-o", "commands.csv"],
            ["ropes.yaml", "--grid", "x=-100:100:2", "--redundant", "preload", "--as", "csv", "-o", "taut.csv"],
            [SCISSORS, "--grid", "x=0:0:1,y=0:320:2", "-p", "shop.params.yaml", "-o", "shop.commands.csv"],
            ["shims.yaml", "--grid", "x=300:400:3,y=200:300:2", "-p", "p.yaml", "--as", "adjust", "-o", "shims.txt"],
            [PLAIN, "--grid", "x=300:400:4,y=200:300:3", "-p", "p.yaml", "--as", "linuxcnc", "-o", "t.comp"],
        ],
        "sensitivity": [[PLAIN, *partly], [PLAIN, "--grid", GRID, "--channel", "x"]], "observability": [
            [PLAIN, "one.csv"], [f"{belts}.yaml", f"{belts}.csv"], [PLAIN, *partly]],
        "calibrate": [
            [PLAIN, "one.csv", "--select", "l1,xb1r"], [PLAIN, "repeated.csv", *WHOLE], [PLAIN, "lost.csv"],
            [PLAIN, "one.csv", "--select", "l1", "--method", "linear"], accepted,
            [HANGPRINTER, HANGPRINTER_DATA, *WHOLE], [f"{belts}.yaml", f"{belts}.csv", "--starts", "2", *WHOLE],
            ["ropes.yaml", "ropes.csv", "--select", "x1,x2,x3", *WHOLE], ["gauge.yaml", "row.csv", *WHOLE],
            [PLAIN, PLAIN_DATA, "--fail-above", "chi2 2", *WHOLE], ["coarse.yaml", PLAIN_DATA, *WHOLE],
            [PLAIN, "dated.csv", *WHOLE],
        ],
        "compare": [["p.yaml", "scaled.params.yaml", "--fail-above", "change 1 m"], ["runs"], [PLAIN, "apart.yaml",
            PLAIN_DATA]],
        "effects": [[], [PLAIN], [PLAIN, "one.csv", "--simulate"]], "study": STUDY, "plan": [
            [PLAIN, PLAIN_DATA, "--next", "--budget", "233", "--aim", "l1 10 um"],
            [PLAIN, "lost.csv"], [PLAIN, "--grid", "x=300:600:4,y=200:350:2",
            "--aim", "scale@q1", "--points", "1", "--power", "1"]],
    }  # fmt: skip


PLANS = ((SCISSORS, SHOPFLOOR), (SCISSORS, SHOPFLOOR, "--aim", "separate:backlash@q1,drift", "--points", "2"))


def searches(folder: Path) -> dict[str, list[list[str]]]:
    """The same of those that take long."""
    return {
        "diagnose": [
            [HANGPRINTER, HANGPRINTER_DATA], [HANGPRINTER, HANGPRINTER_DATA.replace("2021-12-16", "2022-04-12")],
            [SCISSORS, "shop.csv"], [SCISSORS, SHOPFLOOR.replace("-shopfloor", "")], odd_field(folder),
            growing_noise(folder), odd_shape(folder), [SCISSORS, "shop.csv", "--loss", "tukey"],
            [*map(str, router(folder, 1))], ["gauge.yaml", PLAIN_DATA],
        ],
        "improve": [[SCISSORS, "shop.csv", "-o", "improved.yaml", "--loss", "tukey", "--fail-above", "chi2 2"]],
    }  # fmt: skip


STUDY = [[TRIGLIDE, PLAIN, "--within", "x=200:700,y=200:350", "--points", "8", "--repeat", "2"]]
FREE = """
units: {length: mm, force: N}
space: spatial
guides: {rail: {along: z}}
ground: {o: [0, 0, 500]}
bodies: {cart: {guide: rail, at: 100, points: {p: [0, 0, 10]}}, rod: {at: [0, 0, 110], points: {foot: [0, 0, 0]}}}
joints: {ball: {between: [p, foot], type: spherical}}
actuators: {q: {moves: cart}}
sensors: {probe: {at: cart, reads: [z], sigma: 1 um, frame: machine}}
"""


SEARCHING = ("diagnose", "improve")
LONG = dict.fromkeys((*SEARCHING, "plan"), pytest.mark.slow)
SHOWN = [
    "check", "draw", "simulate", "new", "correct", "sensitivity", "observability", "calibrate", "compare", "diagnose",
    "effects", "improve", "plan", "study",
]  # fmt: skip


SELDOM = {  # as in `calibrate`
    "improve": {f"provenance.{key}" for key in ("accepted[]", "implausible[]", "measured_from", "measured_to")}
}


@pytest.mark.parametrize("command", [pytest.param(c, marks=LONG.get(c, ())) for c in SHOWN])
def test_the_documented_keys_are_those_that_are_there(
    command: str, written: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(written)
    known, found = documented()[command], set()
    for arguments in (searches(written) if command in SEARCHING else commands())[command]:
        done = run(command, *arguments, "--json", "-q")
        assert done.code in (0, 1), done.err
        assert faults_of(command, done.json) == []
        found |= set(paths(done.json))
    assert {p for p in found if not covers(p, known)} == set()
    assert known - found == SELDOM.get(command, set())


@pytest.mark.slow
@pytest.mark.parametrize("arguments", PLANS)
def test_other_plans_show_no_other_keys(arguments: tuple[str, ...]) -> None:
    done = run("plan", *arguments, "--json", "-q")
    assert done.code == 0 and faults_of("plan", done.json) == []
    assert {p for p in paths(done.json) if not covers(p, documented()["plan"])} == set()


def test_every_row_of_the_documentation_says_what_or_repeats() -> None:
    text = (ROOT / "docs" / "json.md").read_text()
    for line in re.findall(r"^\| `.*$", text, flags=re.MULTILINE):
        assert line.count("|") == 3, line


def test_keys_that_the_interface_promises_by_name() -> None:
    known = documented()
    parameter = ("name", "nominal", "value", "std", "unit", "identified", "reason")
    plain = ("status", "n_rows", "chi2_per_dof", "condition_number")
    kinds = [f"{when}.KIND.{k}" for when in ("before", "after") for k in ("rms", "max", "criterion", "unit")]
    held = ("heldout.rms_before", "heldout.rms_after", "heldout.scheme")
    assert {*plain, *held, *kinds, *(f"parameters[].{k}" for k in parameter)} <= known["calibrate"]
    numbers = {
        "condition_number", "condition_number_whitened", "rank", "singular_values[]", "O1", "O2", "O3", "O4", "O5",
    }  # fmt: skip
    assert {*numbers, "parameters[].name", "parameters[].std"} <= known["observability"]
    assert {f"parameters[].{k}" for k in ("name", "position", "orientation", "unit")} <= known["sensitivity"]
