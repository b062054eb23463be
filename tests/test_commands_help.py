"""Help texts: the engineer's question first, one runnable example last; errors of the command line in our form."""

from __future__ import annotations

import dataclasses
import importlib
import inspect
import re
import shlex
from pathlib import Path

import pytest

from tests.command import ROOT, run
from tests.test_docs import COMMANDS as PAGES

COMMANDS = sorted(p.stem for p in (ROOT / "pkmcal_cli" / "commands").glob("[a-z]*.py"))


def help_of(command: str) -> str:
    done = run(command, "--help")
    assert done.code == 0 and done.err == ""
    return done.out


def example_of(command: str) -> str:
    """The example at the end of a command's help."""
    _, _, example = help_of(command).rpartition("Example:\n")
    return example.strip()


def test_every_command_is_listed() -> None:
    done = run("--help")
    assert done.code == 0
    listed = re.findall(r"^  ([a-z]+)  ", done.out.partition("Commands:")[2], flags=re.MULTILINE)
    assert listed == COMMANDS


@pytest.mark.parametrize("command", COMMANDS)
def test_help_begins_with_the_engineers_question(command: str) -> None:
    text = help_of(command)
    first = re.split(r"\n\s*\n", text)[1]
    assert "?" in first and text.startswith(f"Usage: pkmcal {command}")


@pytest.mark.parametrize("command", COMMANDS)
def test_help_ends_with_one_runnable_example(command: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """On one line, so that it can be copied; those that a page shows are run there (`tests/test_docs.py`)."""
    example = example_of(command)
    assert "\n" not in example and help_of(command).count("Example:") == 1
    program, name, *arguments = shlex.split(example)
    assert (program, name) == ("pkmcal", command)
    if example in {shown.line.removeprefix("$ ") for _, shown in PAGES}:
        return
    (tmp_path / "machines").symlink_to(ROOT / "machines")
    monkeypatch.chdir(tmp_path)
    done = run(name, *arguments)
    assert done.code == 0, done.err


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
