"""The YAML reader: core schema, places, limits; nothing but `BadInput` leaves it."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from pkmcal_cli.base.errors import BadInput, Location
from pkmcal_cli.yaml_source.read import MAX_BYTES, MAX_DEPTH, read_source
from pkmcal_cli.yaml_source.tree import SourceMap

FUZZ = settings(max_examples=200, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])


def read(folder: Path, text: str | bytes) -> Any:
    file = folder / "m.yaml"
    file.write_bytes(text if isinstance(text, bytes) else text.encode())
    return read_source(str(file))


def refused(folder: Path, text: str | bytes) -> str:
    with pytest.raises(BadInput) as caught:
        read(folder, text)
    assert caught.value.exit_code == 3
    return caught.value.what


@pytest.mark.parametrize(
    ("scalar", "value"),
    [
        ("1e-6", 1e-6), ("1e6", 1e6), ("012", 12), ("12:30", "12:30"), ("no", "no"), ("yes", "yes"),
        ("on", "on"), ("y", "y"), ("true", True), ("False", False), ("~", None), ("", None), ("null", None),
        ("0x1F", 31), ("0o17", 15), ("-.5", -0.5), ("+3", 3), ("1.", 1.0), ("1_000", "1_000"),
        ("2001-01-01", "2001-01-01"), ("'12'", "12"), ('"true"', "true"), ("!!str 12", "12"),
        ("!!float 12", 12), ("210 GPa", "210 GPa"), ("2.05e11", 2.05e11),
    ],
)  # fmt: skip
def test_scalars_follow_the_core_schema(tmp_path: Path, scalar: str, value: object) -> None:
    found = read(tmp_path, f"a: {scalar}\n").root.plain()["a"]
    assert found == value
    assert type(found) is type(value)


def test_every_value_and_key_knows_its_place(tmp_path: Path) -> None:
    source = read(tmp_path, "# head\na:\n  b: [1, {c: 'x'}]\n  d: &t 5\ne: *t\n")
    file = source.file
    places = SourceMap(source.root, {file: source.lines})
    assert places["a", "b"] == Location(file, 3, 6)
    assert places.key(("a", "b")) == Location(file, 3, 3)
    assert places["a", "b", 1, "c"] == Location(file, 3, 14)
    assert places["a", "b", 1, "nothing"] == Location(file, 3, 10)
    assert places["e",] == Location(file, 5, 4)
    assert places.line(places["e",]) == "e: *t"
    assert source.root.plain() == {"a": {"b": (1, {"c": "x"}), "d": 5}, "e": 5}


def test_text_files_of_other_systems(tmp_path: Path) -> None:
    assert read(tmp_path, b"\xef\xbb\xbfa: 1\r\nb: 2\r\n").root.plain() == {"a": 1, "b": 2}
    source = read(tmp_path, "a: 'µm °'\nb: 😀\nc: [😀, 1]\n")
    assert SourceMap(source.root)["c", 1].column == 8


def test_duplicate_keys_are_faults_at_both_places(tmp_path: Path) -> None:
    faults = read(tmp_path, "a: 1\nb: {x: 1, y: 2, x: 3}\na: 2\n").faults.errors
    assert [(f.where.line, f.where.column) for f in faults] == [(1, 1), (2, 5), (2, 17), (3, 1)]
    assert {f.code for f in faults} == {"duplicate-key"}


def test_bombs_and_depths_are_refused(tmp_path: Path) -> None:
    bomb = "a0: &a0 [x,x,x,x,x,x,x,x,x]\n"
    bomb += "".join(f"a{i}: &a{i} [{','.join([f'*a{i - 1}'] * 9)}]\n" for i in range(1, 9))
    assert "values in the file" in refused(tmp_path, bomb)
    assert "aliases" in refused(tmp_path, "a: &a 1\nb: [" + "*a, " * 2000 + "*a]\n")
    assert "inside its own anchor" in refused(tmp_path, "a: &a [*a]\n")
    assert "has no anchor" in refused(tmp_path, "a: *b\n")
    assert "levels of nesting" in refused(tmp_path, "[" * 100_000)
    assert "levels of nesting" in refused(tmp_path, "{a: " * 100_000)
    assert "levels of nesting" in refused(tmp_path, "\n".join(" " * i + "a:" for i in range(200)))
    fits = MAX_DEPTH - 1
    assert read(tmp_path, "a: " + "[" * fits + "]" * fits).root.plain()


def test_large_and_unreadable_files_are_refused(tmp_path: Path) -> None:
    assert "8 MiB" in refused(tmp_path, b"#" * (MAX_BYTES + 1))
    assert read(tmp_path, b"a: 1\n#" + b"x" * (MAX_BYTES - 6)).root.plain() == {"a": 1}
    for name in ("nothing.yaml", "", "a\0b"):
        with pytest.raises(BadInput, match="cannot be read"):
            read_source(str(tmp_path / name))


@pytest.mark.parametrize(
    "text",
    ["", "# only a remark\n", "3", "- a", "a: 1\n---\nb: 2\n", "a: [1", "a: 'x", "\ta: 1", "a: b: c", "a: @x",
     "a: !foo 1", "a: !!set {b}", "a: !!binary aGk=", "a: !!python/name:os.system",
     "a: !!timestamp 2001-01-01", "? [a]\n: 1\n", "? {a: 1}\n: 1\n", "{{i}: 1}", "a: \x00", "%FOO\n", "&a *a",
     b"\xff\xfea\x00", b"a: \xc3("],
)  # fmt: skip
def test_what_is_no_machine_file_is_refused(tmp_path: Path, text: str | bytes) -> None:
    assert refused(tmp_path, text)


@pytest.mark.parametrize("scalar", [".nan", ".NaN", ".inf", "-.INF", "1e999", "-1e999", "9" * 5000])
def test_numbers_that_are_not_finite_are_faults(tmp_path: Path, scalar: str) -> None:
    faults = read(tmp_path, f"a: [1, {scalar}]\n").faults.errors
    assert [(f.code, f.where.column) for f in faults] == [("value", 8)]


@given(st.binary(max_size=200))
@FUZZ
def test_any_bytes_are_read_or_refused(tmp_path: Path, data: bytes) -> None:
    try:
        read(tmp_path, data)
    except BadInput as error:
        assert error.text()


@given(st.text(alphabet="ab1: -[]{},&*!|>'\"#%@`\n\t?~.<", max_size=60))
@FUZZ
def test_any_punctuation_is_read_or_refused(tmp_path: Path, text: str) -> None:
    try:
        read(tmp_path, text).root.plain()
    except BadInput as error:
        assert error.text()
