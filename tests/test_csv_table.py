"""Measurement tables: formats of the field are read, everything doubtful is refused with its place."""

from __future__ import annotations

import hashlib
import io
import sys
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pkmcal_cli.base.errors import BadInput
from pkmcal_cli.csv_files.cells import cell_column
from pkmcal_cli.csv_files.reader import open_table
from tests.csv_tables import Table, read_table


def table(tmp_path: Path, content: str | bytes) -> Table:
    path = tmp_path / "t.csv"
    path.write_bytes(content if isinstance(content, bytes) else content.encode())
    return read_table(path)


def message(tmp_path: Path, content: str | bytes) -> str:
    with pytest.raises(BadInput) as caught:
        table(tmp_path, content)
    return caught.value.text().replace(str(tmp_path) + "/", "")


TWO_ROWS = [[1.5, 2.5], [-3.0, 4.25e-3]]
SAME = {
    "comma": "x,y\n1.5,2.5\n-3,4.25e-3\n",
    "german": "x;y\n1,5;2,5\n-3;4,25e-3\n",
    "semicolon, point": "x;y\n1.5;2.5\n-3;4.25e-3\n",
    "tab": "x\ty\n1.5\t2.5\n-3\t4.25e-3\n",
    "tab, decimal comma": "x\ty\n1,5\t2,5\n-3\t4,25E-3\n",
    "bar": "x|y\n1.5|2.5\n-3|4.25e-3\n",
    "spaces": "  x    y\n 1.5  2.5\n-3    4.25e-3\n",
    "spaces, decimal comma": "x y\n1,5 2,5\n-3 4,25e-3\n",
    "spaces, quoted": '"x" "y"\n1.5 2.5\n-3 4.25e-3\n',
    "blanks after commas": "x, y\n1.5, 2.5\n-3, 4.25e-3\n",
    "byte order mark": "\ufeffx,y\n1.5,2.5\n-3,4.25e-3\n",
    "CRLF": "x,y\r\n1.5,2.5\r\n-3,4.25e-3\r\n",
    "CR": "x,y\r1.5,2.5\r-3,4.25e-3\r",
    "UTF-16": "x\ty\r\n1,5\t2,5\r\n-3\t4,25e-3\r\n".encode("utf-16"),
    "quoted header": '"x","y"\n1.5,2.5\n-3,4.25e-3\n',
    "all quoted, decimal comma": '"x","y"\n"1,5","2,5"\n"-3","4,25e-3"\n',
    "empty lines": "\n\nx,y\n\n1.5,2.5\n\n\n-3,4.25e-3\n\n",
    "lines of separators": "x,y\n1.5,2.5\n,\n-3,4.25e-3\n,\n",
    "trailing separators": "x,y,\n1.5,2.5,\n-3,4.25e-3,\n",
    "trailing separators of rows": "x,y\n1.5,2.5,\n-3,4.25e-3,\n",
    "trailing separators, German": "x;y;;;\n1,5;2,5;;;\n-3;4,25e-3;;;\n",
    "trailing tabs of rows": "x\ty\n1.5\t2.5\t\n-3\t4.25e-3\t\n",
    "padded rows, lines of fewer separators": "x,y,,\n1.5,2.5,,\n,\n-3,4.25e-3,,\n,,,,,\n\n",
    "blanks at the ends": "x   y \n1.5 2.5   \n-3   4.25e-3\n",
    "no end of line at the end": "x,y\n1.5,2.5\n-3,4.25e-3",
    "comments": "# made by hand\n# twice\nx,y\n1.5,2.5\n-3,4.25e-3\n",
    "sep line": "sep=;\nx;y\n1,5;2,5\n-3;4,25e-3\n",
    "plus signs, bare points": "x,y\n+1.5,2.5\n-3.,.00425\n",
}


@pytest.mark.parametrize("content", SAME.values(), ids=SAME.keys())
def test_formats_give_the_same_table(tmp_path: Path, content: str | bytes) -> None:
    found = table(tmp_path, content)
    assert found.names == ("x", "y")
    assert np.column_stack([found.numbers["x"], found.numbers["y"]]).tolist() == TWO_ROWS


def test_blanks_within_cells_part_nothing_where_tabs_do(tmp_path: Path) -> None:
    """With the last cell empty, a row has as many words as columns: its readings would move one to the right."""
    found = table(tmp_path, "id\tx [mm]\ty [mm]\tz [mm]\n1\t1,5\t2,5\t5\n1 234\t-3\t4,25\t\n")
    assert found.notes == ("separator: tab, decimal comma",) and found.texts["id"] == ("1", "1 234")
    assert found.numbers["x"].tolist() == [1.5, -3.0] and found.numbers["y"].tolist() == [2.5, 4.25]
    mixed = table(tmp_path, "id\tx y\n1\t1.5 2.5\n2\t-3 4.25\n")  # tabs alone part fewer names
    assert mixed.numbers["x"].tolist() == [1.5, -3.0] and mixed.numbers["y"].tolist() == [2.5, 4.25]


def test_lines_are_those_of_the_file(tmp_path: Path) -> None:
    assert table(tmp_path, SAME["empty lines"]).lines.tolist() == [5, 8]
    assert table(tmp_path, SAME["sep line"]).lines.tolist() == [3, 4]


def test_the_format_is_announced(tmp_path: Path) -> None:
    assert table(tmp_path, SAME["comma"]).notes == ()
    assert table(tmp_path, SAME["german"]).notes == ("separator: semicolon, decimal comma",)
    assert table(tmp_path, SAME["byte order mark"]).notes == ("starts with a byte order mark",)
    assert table(tmp_path, SAME["empty lines"]).notes == ("3 empty lines skipped",)
    assert table(tmp_path, SAME["trailing separators"]).notes == ("trailing separators ignored",)
    german = table(tmp_path, SAME["german"])
    assert (german.separator, german.decimal) == (";", ",")
    assert table(tmp_path, SAME["comments"]).comments == ("made by hand", "twice")


def test_ansi_file_with_micrometres(tmp_path: Path) -> None:
    found = table(tmp_path, "x [µm];T [°C]\n1,5;20\n".encode("cp1252"))
    assert found.units == ("µm", "°C")
    assert "not UTF-8, read as Windows-1252" in found.notes


def test_units_in_the_header(tmp_path: Path) -> None:
    found = table(tmp_path, '"x [mm]" , q1[deg],plain\n1,2,3\n')
    assert found.names == ("x", "q1", "plain")
    assert found.units == ("mm", "deg", None)
    assert table(tmp_path, "x [mm]  y [m s]\n1 2\n").units == ("mm", "m s")


def test_one_column(tmp_path: Path) -> None:
    assert table(tmp_path, "x\n1\n2\n").numbers["x"].tolist() == [1, 2]
    assert table(tmp_path, "x\n1,5\n2,5\n").numbers["x"].tolist() == [1.5, 2.5]
    assert np.isnan(table(tmp_path, 'x\n1\n""\n2\n').numbers["x"][1])


def test_empty_cells_are_nan_and_labels_stay_text(tmp_path: Path) -> None:
    found = table(tmp_path, "id,x,session\n007,,a b\nNA,2,\n")
    assert np.isnan(found.numbers["x"][0])
    assert found.numbers["x"][1] == 2
    assert found.texts == {"id": ("007", "NA"), "session": ("a b", "")}


def test_decimal_mark_that_comes_late(tmp_path: Path) -> None:
    rows = "".join(f"{i};{i}\n" for i in range(20_000))
    found = table(tmp_path, f"x;y\n{rows}1,5;2,5\n")
    assert found.numbers["x"][-1] == 1.5
    assert found.decimal == ","


def test_stdin(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sys, "stdin", io.TextIOWrapper(io.BytesIO(b"x,y\n1,2\n")))
    found = read_table("-")
    assert found.path == "<stdin>"
    assert found.numbers["y"].tolist() == [2]


def test_pipe(tmp_path: Path) -> None:
    import os
    import threading

    fifo = tmp_path / "fifo"
    os.mkfifo(fifo)
    writer = threading.Thread(target=lambda: fifo.write_text("x;y\n1,5;2\n"))
    writer.start()
    assert read_table(fifo).numbers["x"].tolist() == [1.5]
    writer.join()


REFUSED = {
    "empty file": ("", "t.csv:1: error[csv-empty]: this file contains no table"),
    "blank file": ("\n \n# only\n", "t.csv:1: error[csv-empty]: this file contains no table"),
    "header only": ("x,y\n", "t.csv:1: error[csv-empty]: the table has no rows below the header"),
    "no header": ("1,2\n3,4\n", "t.csv:1:1: error[csv-header]: the first line contains numbers instead"),
    "binary": (b"x,y\n1,\x00\x01\n", "error[csv-binary]: this is a binary file"),
    "spreadsheet": (b"PK\x03\x04rest", "this is a spreadsheet or zip file"),
    "long row": ("x,y\n1,2\n1,2,3\n4,5\n", "t.csv:3:5: error[csv-width]: the row has 3 cells, the header"),
    "short row": ("x,y,z\n1,2,3\n1,2\n4,5,6\n", "t.csv:3:1: error[csv-width]: the row has 2 cells"),
    "long after short": ("x,y,z\n1,2\n1,2,3,4\n1,2,3\n", "t.csv:3:7: error[csv-width]"),
    "NA": ("x,y\n1,NA\n", "t.csv:2:3: error[csv-number]: `NA` in column `y` is not a number"),
    "nan": ("x,y\n1,nan\n", "help: leave the cell empty where nothing was measured"),
    "inf": ("x,y\n1,-inf\n", "error[csv-number]: `-inf` in column `y` is not finite"),
    "too large": ("x,y\n1,1e999\n", "error[csv-number]: `1e999` in column `y` is not finite"),
    "thousands, German": ("x;y\n1.234,5;2\n", "without thousands separators: `1234,5`"),
    "letters for digits": ("x,y\n1,O.5l\n", "write digits, not letters: `0.51`"),
    "thousands, blanks": ("x;y\n1 234,5;2\n", "without thousands separators: `1234,5`"),
    "thousands and the other mark": ("x;y\n1.5;2\n1 234,5;2\n", "without thousands separators: `1234.5`"),
    "thousands, quoted": ('x,y\n"1,234.5",2\n', "without thousands separators: `1234.5`"),
    "thousands, unquoted": ("x,y\n1.5,2.5\n1,234,2.5\n", "check for decimal commas and thousands separators"),
    "decimal and separating comma": (
        "x,y\n1,5,2,5\n",
        "help: export with `;` as separator or with decimal points",
    ),
    "mixed marks": ("x;y\n1,5;2,5\n1.5;2,5\n3,5;2\n", "this file has a decimal comma"),
    "twice": ("x,y,x [mm]\n1,2,3\n", "t.csv:1:5: error[csv-duplicate]: duplicate column `x`"),
    "no name": ("x,,y\n1,2,3\n", "t.csv:1:3: error[csv-header]: column 2 has no name"),
    "open quote": ('x,y\n1,"2\n3,4\n', "t.csv:2:1: error[csv-quote]: a quote is not closed"),
    "open quote in the header": ('"x,y\n1,2\n', "a quote in the header is not closed"),
    "underscores": ("x,y\n1_000,2\n", "`1_000` in column `x` is not a number"),
    "other digits": ("x,y\n\u0661\u0662,2\n", "`\u0661\u0662` in column `x` is not a number"),
    "minus sign": ("x,y\n\u22125,2\n", "help: write the minus sign as `-`: `-5`"),
    "unit in the cell": ("x,y\n5 mm,2\n", "help: write the unit in the header: `x [mm]`"),
    "line of units": ("x,y\nmm,deg\n1,2\n", "t.csv:2:4: error[csv-number]: `deg` in column `y`"),
    "comment below the header": ("x,y\n1,2\n#3,4\n", "help: write comments only before the header"),
    "row commented out": ("id,x\na,1\n#b,2\n", "t.csv:3:1: error[csv-comment]: below the header, a row that begins"),
    "row commented out, indented": ("id,x\n,1\n #b,2\n", "help: delete the row; if the `#` belongs to"),
    "separator too many": (
        "x,y,f\n1,2,\n3,4,\n5,0,6,\n",
        "t.csv:4:1: error[csv-width]: the row has 4 cells, the header",
    ),
    "separator too few": (
        "x,y,f\n1,2,,\n3,4,\n5,6,,\n",
        "t.csv:3:1: error[csv-width]: the row has 3 cells, the other rows have 4",
    ),
    "one of two rows": ("x,y,f,\n1,2,,\n3,4,,,\n", "t.csv:3:1: error[csv-width]: the row has 5 cells, the other rows"),
    "one of two rows, logger": ("x,y,f\n1,2,,\n3,4,\n", "t.csv:2:1: error[csv-width]: the row has 4 cells"),
    "German, too many": ("x;y;f;\n1,5;2;;\n3,5;4;;;\n5;6;;\n", "t.csv:3:1: error[csv-width]: the row has 5 cells"),
    "a value at the end": (
        "x,y,\n1,2,\n3,4,5\n",
        "t.csv:3:5: error[csv-width]: the row has 3 cells, the header has 2",
    ),
    "only the header ends with a separator": (
        "x,y,\n1,2\n3,4\n",
        "t.csv:1:5: error[csv-width]: the header ends with 1 unnamed cell, the rows with none",
    ),
    "the header ends with more": ("x,y,,\n1,2,\n3,4,\n", "unnamed cells, the rows with 1"),
    "narrow rows": ("x,y\n1\n2\n", "t.csv:2:1: error[csv-width]: the header has 2"),
    "title line": ("Report 2021\nx;y\n1,5;2,5\n", "help: line 1 is read as the header"),
    "date": ("x,y\n2021-12-16,4\n", "help: use dates only in column `time`"),
    "no number of C": ("x,y\n1.#QNAN,4\n", "help: leave the cell empty"),
    "semicolon for a mark": ("x,y\n12;5,4\n", "help: write the decimal mark as `.`: `12.5`"),
    "Fortran": ("x,y\n1d3,4\n", "help: write exponents with `e`: `1e3`"),
    "German date": ("x,y\n16.12.2021 10:30,4\n", "help: use dates only in column `time`"),
    "formula": ("x,y\n=1+1,4\n", "help: a spreadsheet's formula"),
    "truth": ("x,y\nTRUE,4\n", "help: write a number, or leave the cell empty"),
    "comment behind": ("x,y\n1,2 # late\n", "help: write comments only before the header"),
    "comment behind, cell": ("x,y\n1,2,# late\n3,4\n5,6\n", "help: write comments only before the header"),
    "error value": ("x,y\n#DIV/0!,2\n", "help: a spreadsheet's error value"),
    "anything": ("x,y\n@@@,2\n", "help: write one number, such as `12.5`"),
    "many columns": (",".join(map(str, range(10_001))) + "\n", "[csv-columns]: the header has 10001 columns"),
    "hexadecimal": ("x,y\n0x10,4\n", "`0x10` in column `x` is not a number"),
}


@pytest.mark.parametrize(("content", "expected"), REFUSED.values(), ids=REFUSED.keys())
def test_refused(tmp_path: Path, content: str | bytes, expected: str) -> None:
    assert expected in message(tmp_path, content)


def test_a_last_line_that_may_be_cut_off(tmp_path: Path) -> None:
    assert "the last line ends with a number and has no line end: was the file cut off?" in table(
        tmp_path, "x,y\n1,2\n3,4"
    ).notes
    for whole in ("x,y\n1,2\n3,4\n", "id,y,z\na,1,\nb,2,"):
        assert not any("cut off" in note for note in table(tmp_path, whole).notes)


def test_the_odd_rows_are_named_and_not_the_others(tmp_path: Path) -> None:
    """Whichever rows are fewer: a cell too many or too few in them, the last column being empty everywhere."""
    for usual in (0, 1, 2):
        rows = ["1,2," + "," * usual] * 30
        rows[4] += ","
        rows[20] = "1,2" + "," * usual
        for header in {"x,y,f", "x,y,f" + "," * usual}:
            text = message(tmp_path, "\n".join([header, *rows]))
            assert text.count("error[") == 2, (header, text)
            assert "t.csv:6:1: error[csv-width]" in text
            assert "t.csv:22:1: error[csv-width]" in text
            assert "remove the extra separator (cells after it are in the wrong columns)" in text


def test_zero_byte_far_down(tmp_path: Path) -> None:
    rows = "1,2\n" * 30_000
    assert "t.csv:30002: error[csv-binary]" in message(tmp_path, f"x,y\n{rows}1,\x002\n")


def test_all_faults_at_once_and_the_rest_counted(tmp_path: Path) -> None:
    text = message(tmp_path, "x,y\n" + "NA,1\n1\n" * 40)
    assert text.count("error[") == 50
    assert text.endswith("... and 30 more faults")
    assert "t.csv:2:1: error[csv-number]" in text
    assert "t.csv:3:1: error[csv-width]" in text


def test_the_caret_is_under_the_cell(tmp_path: Path) -> None:
    lines = message(tmp_path, 'id;x;y\n"a;b" ;  1,5;NA\n').splitlines()
    assert lines[0].startswith("t.csv:2:14: ")
    assert lines[1][lines[2].index("^") :] == "NA"


@pytest.mark.parametrize("separator", [",", ";", "\t", " "])
@given(cells=st.lists(st.from_regex(r"[a-z0-9]{1,5}", fullmatch=True), min_size=1, max_size=6))
def test_cell_columns(separator: str, cells: list[str]) -> None:
    line = separator.join(cells)
    for index, cell in enumerate(cells):
        assert line[cell_column(line, separator, index) - 1 :].startswith(cell)


def test_missing_file_names_the_nearest(tmp_path: Path) -> None:
    (tmp_path / "session1.csv").write_text("x\n1\n")
    with pytest.raises(BadInput, match="the file does not exist") as caught:
        read_table(tmp_path / "sesion1.csv")
    assert "did you mean `session1.csv`?" in caught.value.text()
    with pytest.raises(BadInput, match="the file cannot be read"):
        read_table(tmp_path)


def test_checksum(tmp_path: Path) -> None:
    found = table(tmp_path, "x,y\n1,2\n")
    assert found.sha256 == hashlib.sha256(b"x,y\n1,2\n").hexdigest()
    with open_table(tmp_path / "t.csv") as reader:
        assert reader.size == 8
