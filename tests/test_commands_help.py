"""Help texts: the engineer's question first, one runnable example last; errors of the command line in our form."""

from __future__ import annotations

import dataclasses
import importlib
import inspect
import re
import shlex
from contextlib import nullcontext
from pathlib import Path

import pytest

from tests.command import ROOT, Done, run
from tests.test_commands_report import UNSEARCHED
from tests.test_docs import COMMANDS as PAGES

COMMANDS = sorted(p.stem for p in (ROOT / "pkmcal_cli" / "commands").glob("[a-z]*.py"))
WORK = [
    "new", "check", "draw", "simulate", "sensitivity", "observability", "plan", "calibrate", "diagnose", "improve",
    "correct", "report", "compare", "study", "effects", "schema",
]  # fmt: skip
"""Commands in the order of work."""
LONG = (
    "diagnose", "improve", "report", "plan 0", "plan 2", "study 0", "study 1", "calibrate 1", "compare 1", "draw 1",
)  # fmt: skip
"""Commands, and single examples, that take long."""


def help_of(command: str) -> str:
    done = run(command, "--help")
    assert done.code == 0 and done.err == ""
    return done.out


def examples_of(command: str) -> list[str]:
    """The examples at the end of a command's help."""
    _, _, examples = help_of(command).rpartition("Examples:\n")
    return [line.strip() for line in re.sub(r" \\\n +", " ", examples).strip().splitlines()]


def unfolded(text: str) -> str:
    """A text in one line."""
    return re.sub(r"-\s+", "-", " ".join(text.split()))


def run_line(line: str) -> Done:
    """A line of a shell, in this process: each command reads what the one before has written."""
    told: str | None = None
    for part in line.split(" | "):
        program, *arguments = shlex.split(part)
        if program == "cat":
            told = Path(arguments[0]).read_text(encoding="utf-8")
            continue
        assert program == "pkmcal"
        done = run(*arguments, stdin=told)
        assert done.code == 0, done.err
        told = done.out
    return done


def test_every_command_is_listed_in_the_order_of_work() -> None:
    done = run("--help")
    assert done.code == 0
    listed = re.findall(r"^  ([a-z]+)  ", done.out.partition("Commands:")[2], flags=re.MULTILINE)
    assert listed == [name for name in WORK if name in COMMANDS] and sorted(listed) == COMMANDS


def test_the_overview_has_whole_questions() -> None:
    """Not cut: all that stands before the first blank line of each command's help."""
    done = run("-h")
    overview = unfolded(done.out.partition("Commands:")[2])
    assert "..." not in overview and max(map(len, done.out.splitlines())) <= 80
    for command in COMMANDS:
        question = unfolded(re.split(r"\n\s*\n", help_of(command))[1])
        assert f"{command} {question}" in overview


@pytest.mark.parametrize("command", ["", *COMMANDS])
def test_a_short_option_asks_for_help_too(command: str) -> None:
    arguments = [command] if command else []
    assert run(*arguments, "-h").out == run(*arguments, "--help").out != ""


@pytest.mark.parametrize("command", COMMANDS)
def test_help_begins_with_the_engineers_question(command: str) -> None:
    text = help_of(command)
    first = re.split(r"\n\s*\n", text)[1]
    assert "?" in first and text.startswith(f"Usage: pkmcal {command}")


@pytest.mark.parametrize("command", COMMANDS)
def test_help_shows_every_way_to_call_it(command: str) -> None:
    """A file, stdin, several files and `--json`, where the command takes them."""
    examples, text = examples_of(command), help_of(command)
    assert all(line.split(" | ")[-1].startswith(f"pkmcal {command} ") for line in examples)
    assert text.count("Examples:") == 1 and re.sub(r" \\\n +", " ", text).rstrip().endswith(examples[-1])
    assert max(map(len, text.splitlines())) <= 80
    every = " ".join(examples)
    assert ("- is stdin" in text) <= (" | " in every)
    assert ("\n  --json" in text) <= ("--json" in every)
    assert ("MEAS.csv..." in text) <= bool(re.search(r"\.csv \S+\.csv", every))


def cases() -> list[object]:
    """Examples by command; those of searches take long."""
    return [
        pytest.param(command, line, marks=[pytest.mark.slow] if {command, name} & set(LONG) else [], id=name)
        for command in COMMANDS for k, line in enumerate(examples_of(command)) for name in [f"{command} {k}"]
    ]  # fmt: skip


@pytest.mark.parametrize(("command", "line"), cases())
def test_examples_of_the_help_run(
    command: str, line: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Those that a page shows are run there (`tests/test_docs.py`); sheets have tests of their search elsewhere."""
    if line in {shown.line.removeprefix("$ ") for _, shown in PAGES}:
        return
    (tmp_path / "machines").symlink_to(ROOT / "machines")
    monkeypatch.chdir(tmp_path)
    with UNSEARCHED if command == "report" else nullcontext():
        done = run_line(line)
    if "--json" in line:
        assert done.json["schema"] == f"pkmcal/{command}/1"


@pytest.mark.parametrize(
    ("arguments", "told", "help_"),
    [
        (["chekc"], "chekc", "pkmcal --help"),
        (["check"], "MACHINE.yaml", "pkmcal check --help"),
        (["check", "--bogus", "m.yaml"], "--bogus", "pkmcal check --help"),
        (["simulate", "m.yaml", "--seed", "x"], "--seed", "pkmcal simulate --help"),
        (["simulate", "m.yaml", "--grid"], "--grid", "pkmcal simulate --help"),
        (["schema", "more"], "more", "pkmcal schema --help"),
        (["--bogus"], "--bogus", "pkmcal --help"),
        (["calibrate", "m.yaml"], "MEAS.csv", "pkmcal calibrate --help"),
    ],
)
def test_errors_of_the_command_line_are_in_our_form(arguments: list[str], told: str, help_: str) -> None:
    done = run(*arguments)
    head, hint = done.err.splitlines()
    assert done.code == 2 and done.out == ""
    assert head.startswith("error[usage]: ") and told in head
    assert hint == f"help: see `{help_}`"


def test_without_arguments_the_help_is_shown_as_an_error() -> None:
    done = run()
    assert done.code == 2 and done.out == "" and "Commands:" in done.err


@pytest.mark.parametrize(
    "words",
    [("--plot", "a.svg", "--plot", "b.svg"), ("--plot=a.svg", "--plot", "b.svg"), ("-p", "a", "--parameters", "b")],
)
def test_an_option_with_one_value_is_given_once(words: tuple[str, ...]) -> None:
    """The last one would count, and the first be lost without a word."""
    done = run("simulate", "triglide", *words)
    assert done.code == 2 and "is given twice" in done.err and "help: give it once" in done.err
    assert run("calibrate", "triglide", "nope.csv", "--holdout", "none", "--holdout", "none").code == 3, "the same"
    assert run("observability", "triglide", "--offset", "q1=1 um", "--offset", "q2=1 um", "-q").code != 2


def test_the_version() -> None:
    from pkmcal_cli import __version__

    assert run("--version").out == f"pkmcal {__version__}\n"


def test_schema_is_that_of_the_machines_folder() -> None:
    done = run("schema")
    assert done.code == 0 and '"$schema": "http://json-schema.org/draft-07/schema#"' in done.out
    assert run("schema", "--overlay").out != done.out


def test_a_command_is_one_small_module() -> None:
    """Read, call one function, write."""
    for name in COMMANDS:
        text = (ROOT / "pkmcal_cli" / "commands" / f"{name}.py").read_text()
        body = text[text.rindex('"""\n    ') :]
        assert 1 < len(body.splitlines()) <= 10


@pytest.mark.parametrize("name", COMMANDS)
def test_options_are_what_is_asked_for(name: str) -> None:
    """Every option of a command is a field of its request, or of what that consists of."""
    module = importlib.import_module(f"pkmcal_cli.commands.{name}")
    code = inspect.getsource(getattr(module, name))
    kinds = [
        getattr(importlib.import_module(m), k)
        for m, k in re.findall(r"from (\S+) import (\w*(?:Request|FitOptions))", code)
    ]
    if kinds:
        asked = {f.name for kind in kinds for f in dataclasses.fields(kind)} - {"fit_options", "case"}
        assert asked == set(inspect.signature(getattr(module, name)).parameters)
