"""What the shell proposes: commands, options, names of the machine file on the line; quickly, and never an error."""

from __future__ import annotations

import os
import sys
from pathlib import Path
from typing import get_args

import pytest

from pkmcal_cli.commands._group import names as commands
from pkmcal_cli.correction.formats import formats
from pkmcal_cli.correction.redundancy import Choice
from pkmcal_cli.loading.names import names_in
from tests.command import MACHINES, ROOT, TRIGLIDE, process, run

PLACES = ("q1", "q2", "q3", "all")
DELTA = str(MACHINES / "delta-printer.yaml")
OVERLAY = str(MACHINES / "triglide-nonredundant.yaml")


def proposed(line: str, tmp_path: Path) -> list[str]:
    """What bash gets for a line whose last word is not finished."""
    words = line.split(" ")
    done = process(
        cwd=tmp_path, _PKMCAL_COMPLETE="complete_bash", COMP_WORDS="\n".join(words), COMP_CWORD=str(len(words) - 1),
        _TYPER_COMPLETE_ARGS=line, PYTHONPATH=str(ROOT),
    )  # fmt: skip
    assert done.code == 0 and done.err == "", done.err
    return done.out.split()


def test_commands_and_options(tmp_path: Path) -> None:
    assert proposed("pkmcal cal", tmp_path) == ["calibrate"]
    assert {"--select", "--starts", "--seed"} <= set(proposed("pkmcal calibrate --s", tmp_path))


@pytest.mark.parametrize(
    ("line", "names"),
    [
        (f"pkmcal calibrate {TRIGLIDE} x.csv --select xb1", ["xb1r"]),
        (f"pkmcal calibrate {TRIGLIDE} x.csv --select auto,-yb", ["auto,-yb1r", "auto,-yb2r", "auto,-yb3r"]),
        (f"pkmcal calibrate {TRIGLIDE} x.csv --select l1,l", ["l1,l2", "l1,l3"]),
        ("pkmcal calibrate triglide x.csv --select l1,l", ["l1,l2", "l1,l3"]),
        (f"pkmcal calibrate {DELTA} x.csv --select auto,-stop", ["auto,-stop1", "auto,-stop2", "auto,-stop3"]),
        (f"pkmcal observability {DELTA} --offset q", ["q1=", "q2=", "q3="]),
        (f"pkmcal observability {TRIGLIDE} --offset q", ["q1=", "q2=", "q3="]),
        (f"pkmcal plan {TRIGLIDE} --aim backlash@q", ["backlash@q1", "backlash@q2", "backlash@q3"]),
        (f"pkmcal improve {TRIGLIDE} x.csv --only drift@t", ["drift@tracker"]),
        (f"pkmcal improve {TRIGLIDE} x.csv --only drift@q", []),
        (f"pkmcal improve {TRIGLIDE} x.csv --only backlash@t", []),
        (f"pkmcal improve {TRIGLIDE} x.csv --only resetu", []),
        (f"pkmcal plan {TRIGLIDE} --aim separate:drift@tracker,backlash@a", ["separate:drift@tracker,backlash@all"]),
        (f"pkmcal calibrate {DELTA} x.csv --fail-above std:stop", ["std:stop1", "std:stop2", "std:stop3"]),
        (f"pkmcal calibrate {TRIGLIDE} x.csv --loss h", ["huber"]),
        (f"pkmcal sensitivity {TRIGLIDE} --channel r", ["rx", "ry", "rz"]),
        ("pkmcal schema --output cal", ["calibrate"]),
        (f"pkmcal improve {TRIGLIDE} x.csv --only drift@tracker,windu", [f"drift@tracker,windup@{p}" for p in PLACES]),
        (f"pkmcal plan {TRIGLIDE} --aim windu", [f"windup@{p}" for p in PLACES]),
        (f"pkmcal improve {TRIGLIDE} x.csv --only nosuch", []),
        ("pkmcal calibrate nowhere.yaml x.csv --select x", []),
        (f"pkmcal calibrate {MACHINES} x.csv --select x", []),
    ],
)  # fmt: skip
def test_names_of_the_file_on_the_line(line: str, names: list[str], tmp_path: Path) -> None:
    assert proposed(line, tmp_path) == names


def test_choices_are_all_there_are(tmp_path: Path) -> None:
    """What the shell proposes for a choice is what the program takes."""
    assert proposed("pkmcal correct triglide --as ", tmp_path) == list(formats())
    assert proposed("pkmcal correct triglide --redundant ", tmp_path) == list(get_args(Choice))
    templates = (ROOT / "pkmcal_cli" / "templates").glob("*.yaml")
    assert set(proposed("pkmcal new ", tmp_path)) == {file.stem for file in templates}
    assert proposed("pkmcal schema --output ", tmp_path) == commands()


def test_parameters_of_effects_are_those_of_the_file(tmp_path: Path) -> None:
    (tmp_path / "a.yaml").write_text(f"extends: {TRIGLIDE}\neffects: {{backlash@q2: {{}}}}\n")
    line = f"pkmcal calibrate {tmp_path}/a.yaml x.csv --select auto,backlash@"
    assert proposed(line, tmp_path) == ["auto,backlash@q2.b"]


def test_names_are_those_at_the_end_of_overlays(tmp_path: Path) -> None:
    told = run("check", OVERLAY, "--json", "-q").json
    assert set(names_in(OVERLAY, "parameters")) == {p["name"] for p in told["parameters"]}
    assert len(names_in(OVERLAY, "actuators")) == told["actuators"] == 2
    (tmp_path / "a.yaml").write_text(f"extends: {TRIGLIDE}\nparameters: {{l1: null, more: 3}}\n")
    found = names_in(str(tmp_path / "a.yaml"), "parameters")
    assert "more" in found and "l1" not in found and "l2" in found


@pytest.mark.parametrize(
    "text",
    ["", "[1, 2", "parameters: [a, b]", "parameters: 3", "extends: a.yaml", "extends: [a]", "&a [*a]", "\0", "- 1",
     "parameters: {? [1, 2] : 3}", "[" * 5000, "a: 1\na: 2"],
)  # fmt: skip
def test_a_file_that_is_no_machine_proposes_nothing(text: str, tmp_path: Path) -> None:
    file = tmp_path / "a.yaml"
    file.write_text(text)
    assert names_in(str(file), "parameters") == []


def test_what_is_no_file_is_not_waited_for(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "pipe")
    assert names_in(str(tmp_path / "pipe"), "parameters") == [] == names_in("-", "parameters")


def test_a_large_file_is_left_alone(tmp_path: Path) -> None:
    (tmp_path / "a.yaml").write_text("parameters: {a: 1}\n#" + "x" * (1 << 20))
    assert names_in(str(tmp_path / "a.yaml"), "parameters") == []


def test_the_names_are_read_without_the_engine() -> None:
    code = "import sys; from pkmcal_cli.loading.names import names_in; print(names_in(sys.argv[1], 'sensors'))"
    code += "; print([m for m in ('numpy', 'scipy', 'pandas', 'pydantic') if m in sys.modules])"
    import subprocess

    from tests.command import environment

    done = subprocess.run(
        [sys.executable, "-c", code, TRIGLIDE], env=environment(), capture_output=True, text=True, check=True, cwd=ROOT
    )
    assert done.stdout.splitlines() == ["['tracker']", "[]"]
