"""Measurement tables: the fast reader is the plain one, and no bytes whatever make a wrong table."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, example, given, settings
from hypothesis import strategies as st

from pkmcal_cli.base.errors import BadInput
from pkmcal_cli.csv_files import reader as csv_table
from pkmcal_cli.csv_files.cell_values import ColumnRules, FaultLog, Parser
from pkmcal_cli.csv_files.dialect import Format, find_format, split_header
from tests.csv_tables import read_table, write_table

ODD = ["", " 1 ", "nan", "NA", "inf", "1_0", "1e5", "1E-3", ".5", "5.", "1e400", "0x1", "+1", "1,5", "-"]
CELL = st.one_of(
    st.floats(allow_nan=False, allow_infinity=False).map(repr),
    st.integers(-(10**6), 10**6).map(str),
    st.sampled_from(ODD),
)
LINE = st.one_of(
    st.lists(CELL, min_size=3, max_size=3),
    st.lists(CELL, max_size=5),
    st.builds(lambda cells, ends: [*cells, *ends], st.lists(CELL, max_size=3), st.lists(st.just(""), max_size=3)),
)


@settings(max_examples=300, suppress_health_check=[HealthCheck.too_slow], deadline=None)
@given(
    rows=st.lists(LINE, min_size=1, max_size=6), separator=st.sampled_from([",", ";", "\t"]), trailing=st.integers(0, 2)
)
@example(rows=[["1", "2"], ["1", "2", "3", "4"]], separator=",", trailing=0)
@example(rows=[["1", "2", ""], ["", "", ""]], separator=";", trailing=0)
@example(rows=[["1", "2", "a", ""], ["1", "2", "a"], ["1", "2", "a", "", ""]], separator=",", trailing=1)
@example(rows=[["1", "2", "a", ""], ["1", "2", "a", "7"]], separator=",", trailing=1)
def test_fast_and_plain_reader_agree(rows: list[list[str]], separator: str, trailing: int) -> None:
    block = "".join(separator.join(row) + "\n" for row in rows)
    header = tuple(split_header(name) for name in ("x", "y", "id"))
    form = Format(separator=separator, decimal=".", decimal_seen=True, header_line=1, header=header, trailing=trailing)
    plan = ColumnRules(("number", "number", "text"))
    results = []
    for fast in (True, False):
        log = FaultLog("t.csv", separator)
        chunk = Parser(form, plan, {}, fast).parse(block, 2, log)
        numbers = {i: values.tolist() for i, values in chunk.numbers.items()}
        results.append((chunk.lines.tolist(), repr(numbers), chunk.texts, [f.text() for f in log.faults]))
    assert results[0] == results[1]


def test_large_file_goes_through_pandas(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    rng = np.random.default_rng(1)
    values = rng.normal(size=(3000, 3)) * 10.0 ** rng.integers(-12, 12, size=(3000, 3))
    path = tmp_path / "t.csv"
    write_table(path, [(name, None, values[:, i]) for i, name in enumerate("xyz")])
    plain = read_table(path)
    monkeypatch.setattr(csv_table, "_LARGE", 0)
    monkeypatch.setattr(csv_table, "_BLOCK", 5000)
    calls = []
    original = Parser._parse_with_pandas
    monkeypatch.setattr(Parser, "_parse_with_pandas", lambda *a: calls.append(1) or original(*a))
    fast = read_table(path)
    assert len(calls) > 10
    assert fast.lines.tolist() == plain.lines.tolist() == list(range(2, 3002))
    for i, name in enumerate("xyz"):
        assert (fast.numbers[name] == values[:, i]).all()
        assert (plain.numbers[name] == values[:, i]).all()


def test_a_fault_deep_in_a_large_file_has_its_line(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(csv_table, "_LARGE", 0)
    monkeypatch.setattr(csv_table, "_BLOCK", 5000)
    rows = ["1.5,2.5"] * 5000
    rows[3456] = "1.5,2.5,"
    rows[3457] = "1.5"
    path = tmp_path / "t.csv"
    path.write_text("x,y\n" + "\n".join(rows))
    with pytest.raises(BadInput) as caught:
        read_table(path)
    assert f"{path}:3459:1: error[csv-width]" in caught.value.text()


@pytest.mark.parametrize("large", [0, 1 << 22], ids=["fast", "plain"])
@pytest.mark.parametrize("odd", ["1.5,7,2.5,,", "1.5,,"])
def test_an_odd_row_beyond_the_head(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, large: int, odd: str) -> None:
    monkeypatch.setattr(csv_table, "_LARGE", large)
    monkeypatch.setattr(csv_table, "_BLOCK", 5000)
    rows = ["1.5,2.5,,"] * 20_000
    rows[15_000] = odd
    path = tmp_path / "t.csv"
    path.write_text("x,y,f\n" + "\n".join(rows))
    with pytest.raises(BadInput) as caught:
        read_table(path)
    assert [str(fault.where) for fault in caught.value.faults] == [f"{path}:15002:1"]
    assert "the other rows have 4" in caught.value.text()


@settings(max_examples=300, deadline=None)
@given(data=st.binary(max_size=200))
def test_any_bytes_give_a_table_or_faults(data: bytes, tmp_path_factory: pytest.TempPathFactory) -> None:
    path = tmp_path_factory.getbasetemp() / "fuzz.csv"
    path.write_bytes(data)
    try:
        read_table(path)
    except BadInput as error:
        assert error.faults


@settings(max_examples=300, deadline=None)
@given(text=st.text(alphabet='xy12.,;"\t \n\r-e#[]m\u00b5', max_size=60))
def test_any_text_gives_a_table_or_faults(text: str, tmp_path_factory: pytest.TempPathFactory) -> None:
    path = tmp_path_factory.getbasetemp() / "fuzz.csv"
    path.write_bytes(text.encode())
    try:
        found = read_table(path)
    except BadInput as error:
        assert error.faults
    else:
        assert all(np.isfinite(v[~np.isnan(v)]).all() for v in found.numbers.values())


@settings(max_examples=200, deadline=None)
@given(
    rows=st.lists(st.tuples(st.floats(-1e3, 1e3), st.floats(-1e-6, 1e-6), st.integers(-9, 9)), min_size=1, max_size=8),
    decimal=st.sampled_from(".,"),
    separator=st.sampled_from(",;\t| "),
)
def test_separator_and_decimal_mark_are_found(
    rows: list[tuple[float, float, int]], decimal: str, separator: str
) -> None:
    if decimal == separator:
        return
    lines = [separator.join(repr(v).replace(".", decimal) for v in row) for row in rows]
    found = find_format([separator.join(("q1", "x [mm]", "n")), *lines])
    assert isinstance(found, Format)
    assert found.separator == separator
    assert found.decimal == decimal or not found.decimal_seen
