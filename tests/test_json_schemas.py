"""`pkmcal schema --output COMMAND`: every output is what its schema says, and the schema says something."""

from __future__ import annotations

import copy
import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from jsonschema import Draft7Validator

from pkmcal_cli.commands._group import names
from pkmcal_cli.report.outputs.keys import Output
from pkmcal_cli.report.outputs.schema import output_schema
from tests.command import HANGPRINTER, MACHINES, TRIGLIDE, run
from tests.json_schemas import faults_of, validator
from tests.reference_cases import CASES, Case

HEAD = {"program": "pkmcal 0", "python": "3", "numpy": "2", "scipy": "1", "inputs": {}}
MORE: dict[str, dict[str, Any]] = {
    "simulate": {"seed": 0, "noise": "none", "method": "exact"}, "correct": {"redundant": "min-force", "at": None},
    "calibrate": {"seed": None, "status": "converged"}, "improve": {"seed": 0, "status": "converged"},
    "plan": {"seed": 0},
}  # fmt: skip
WITHOUT = {"schema"}  # commands without `--json`


def kept(case: Case) -> Any:
    """A kept output, with the provenance that is not kept; None of what was refused."""
    told = json.loads(case.file.read_text(encoding="utf-8"))
    del told["exit_code"]
    return None if "refused" in told else told | {"provenance": HEAD | MORE.get(case.command, {})}


@pytest.mark.parametrize("case", CASES, ids=lambda c: c.name)
def test_every_kept_output_is_what_its_schema_says(case: Case) -> None:
    output = kept(case)
    if output is not None:
        assert faults_of(case.command, output) == []


def test_every_command_with_json_has_a_schema() -> None:
    commands = [name for name in names() if "\n  --json" in run(name, "--help").out]
    assert set(names()) - set(commands) == WITHOUT
    for name in commands:
        assert validator(name).schema["$id"] == f"pkmcal/{name}/1"


def leaves(value: Any, path: tuple[str | int, ...] = ()) -> Iterator[tuple[str | int, ...]]:
    """Paths of everything inside."""
    for key, inner in value.items() if isinstance(value, dict) else enumerate(value[:2]):
        yield (*path, key)
        if isinstance(inner, dict | list):
            yield from leaves(inner, (*path, key))


def without(output: Any, path: tuple[str | int, ...]) -> Any:
    """An output without what stands at a path."""
    out = copy.deepcopy(output)
    place = out
    for step in path[:-1]:
        place = place[step]
    del place[path[-1]]
    return out


@pytest.mark.parametrize("command", ["calibrate", "plan", "check"])
def test_what_is_lacking_is_noticed(command: str) -> None:
    """Nearly every key must be there: taken out one by one of a kept output."""
    output = kept(next(c for c in CASES if c.command == command and c.table.stem == "biglide"))
    paths = [p for p in leaves(output) if isinstance(p[-1], str)]
    missed = [p for p in paths if not faults_of(command, without(output, p))]
    free = [p for p in missed if "KIND" not in str(p)]
    assert len(free) < 0.5 * len(paths) and ("schema",) not in missed and ("verdict",) not in missed


def test_a_new_or_wrong_key_is_noticed() -> None:
    output = kept(next(c for c in CASES if c.name == "biglide.calibrate"))
    assert faults_of("calibrate", output | {"more": 1})
    assert faults_of("calibrate", output | {"status": "fine"}) and faults_of("calibrate", output | {"rank": "all"})
    assert faults_of("calibrate", output | {"schema": "pkmcal/check/1"})


def test_marks_of_keys() -> None:
    text = """
a text: what it is,
    in two lines
b?.c number?: nullable, in what may be null
d~[].NAME integer: counts
---
e x|y:
"""
    schema = output_schema(Output("made", text))
    good = {
        "schema": "pkmcal/made/1", "verdict": "v", "provenance": HEAD, "a": "t", "b": {"c": None}, "e": "x",
        "d": [{"any": 1, "other": 2}],
    }  # fmt: skip
    check = Draft7Validator(schema)
    assert check.is_valid(good) and check.is_valid(good | {"b": None})
    assert check.is_valid({k: v for k, v in good.items() if k != "d"})
    for wrong in ({"a": None}, {"b": {}}, {"b": {"c": "1"}}, {"d": None}, {"d": [{"any": 1.5}]}, {"e": "z"}):
        assert not check.is_valid(good | wrong), wrong
    assert schema["properties"]["a"]["description"] == "what it is, in two lines"
    with pytest.raises(ValueError, match="no key: b"):
        _ = Output("made", "b").parts


@pytest.mark.parametrize(
    ("arguments", "told"),
    [(("--output", "calibrat"), "did you mean `calibrate`?"), (("--output", "m.json"), "a file is named with `-o`"),
     (("--output", "check", "--overlay"), "give one of them")],
)  # fmt: skip
def test_no_such_output(arguments: tuple[str, ...], told: str) -> None:
    done = run("schema", *arguments)
    assert done.code == 2 and told in done.err and done.out == ""


def test_all_begin_and_end_alike(tmp_path: Path) -> None:
    cases = (
        ("check", TRIGLIDE), ("effects", HANGPRINTER), ("new", "--from", str(MACHINES / "printer.cfg")),
        ("simulate", TRIGLIDE, "--grid", "x=300:400:2"),
    )  # fmt: skip
    for command, *arguments in cases:
        target = ("-o", str(tmp_path / f"{command}.out")) if command in ("new", "simulate") else ()
        told = run(command, *arguments, *target, "--json", "-q").json
        assert list(told)[:2] == ["schema", "verdict"] and list(told)[-1] == "provenance"
        assert told["schema"] == f"pkmcal/{command}/1" and told["provenance"]["arguments"][0] == command
