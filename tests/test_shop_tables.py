"""Tables as spreadsheets, accounts and controllers write them: read as they are meant, or refused with the remedy."""

from __future__ import annotations

from pathlib import Path

import pytest

from pkmcal_cli.base.errors import BadInput
from tests.csv_tables import Table, read_table


def table(tmp_path: Path, content: str) -> Table:
    (tmp_path / "t.csv").write_text(content, encoding="utf-8")
    return read_table(tmp_path / "t.csv")


@pytest.mark.parametrize("above", [";;\n", ";;\n\n;;;\n", "\t\n,\n", " ; ; \n"])
def test_lines_of_separators_above_the_header_are_empty_lines(above: str, tmp_path: Path) -> None:
    """A spreadsheet writes its empty rows so."""
    read = table(tmp_path, f"# of the shop\n{above}x;y;z\n1,5;2;3\n4;5,5;6\n")
    assert [read.numbers[n].tolist() for n in "xyz"] == [[1.5, 4.0], [2.0, 5.5], [3.0, 6.0]]


def test_remarks_that_a_spreadsheet_has_saved(tmp_path: Path) -> None:
    """In quotes where they contain its separator, and with a cell for every column; `"#"` may be the name of one."""
    read = table(tmp_path, '"# simulated; by ""us""";;\n# kind: a;;\n"#";x;y\n1;1,5;2\n')
    assert read.numbers["x"].tolist() == [1.5] and "simulated: no measurements" in read.notes


REMEDIES = {
    "minus behind": ("12.5-", "before the number: `-12.5`"),
    "dash behind": ("12.5\u2212", "before the number: `-12.5`"),
    "account": ("(12.5)", "a negative number as `-12.5`, or leave the cell empty"),
    "number and date": ("12.03.2024", "a spreadsheet may have made a date of a number"),
    "day and month": ("12. Mrz", "a spreadsheet may have made a date of a number"),
    "month and day": ("Mar-12", "a spreadsheet may have made a date of a number"),
    "French month": ("12 ao\u00fbt", "a spreadsheet may have made a date of a number"),
    "version": ("5.0.1", "write one number with one decimal mark"),
    "line of units": ("[mm]", "write the unit in the header: `x [mm]`"),
    "may be": ("may", "write one number, such as `12.5`"),
}


@pytest.mark.parametrize(("cell", "remedy"), REMEDIES.values(), ids=REMEDIES.keys())
def test_remedies(cell: str, remedy: str, tmp_path: Path) -> None:
    with pytest.raises(BadInput) as caught:
        table(tmp_path, f"x,y\n1.5,2\n{cell},4\n")
    (fault,) = caught.value.faults
    assert fault.where is not None and (fault.where.line, fault.where.column) == (3, 1)
    assert remedy in str(fault.hint)


def test_seconds_of_angles_are_no_open_quotes(tmp_path: Path) -> None:
    with pytest.raises(BadInput, match="a quote is not closed") as caught:
        table(tmp_path, "x\ty\n105\u00b037'0.16\"\t38.5\n104\u00b03'1\"\t43\n")
    assert "write angles as decimal numbers" in str(caught.value.faults[0].hint)


@pytest.mark.parametrize("ids", [("1", "2"), ("p1", "p2")])
def test_decimal_commas_between_commas_beside_whole_ids(ids: tuple[str, str], tmp_path: Path) -> None:
    with pytest.raises(BadInput, match="5 cells") as caught:
        table(tmp_path, f"id,x,y\n{ids[0]},1,5,2,5\n{ids[1]},3,5,4,5\n")
    assert "a decimal comma looks like the separator" in str(caught.value.faults[0].hint)


@pytest.mark.parametrize("mark", ["", "\ufeff"])
@pytest.mark.parametrize("header", ["id,x [mm],y", '"id","x [mm]","y"'])
def test_a_header_among_the_rows(header: str, mark: str, tmp_path: Path) -> None:
    """Two tables, one below the other, each with its byte order mark if it has one."""
    with pytest.raises(BadInput) as caught:
        table(tmp_path, f"{mark}{header}\n1,2,3\n4,5,6\n{mark}{header}\n7,8,9\n")
    (fault,) = caught.value.faults
    assert fault.code == "csv-header" and fault.where is not None and fault.where.line == 4
    assert "delete the line" in str(fault.hint) and "session" in str(fault.hint)
