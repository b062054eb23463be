"""Measurement tables as sheets of cells, and what goes wrong with them between the instrument and the program.

A mutation changes a sheet where an engineer, a spreadsheet or a logger would: cells, rows, columns, names, units, the
way the file is written. The sheet still knows how it is written, which the program must find out.
"""

from __future__ import annotations

import random
from collections.abc import Callable
from dataclasses import dataclass, field


@dataclass(kw_only=True)
class Sheet:
    """A table on its way to a file: header cells, rows of cells, how it is written; `raw`: bytes changed at the end."""

    header: list[str]
    rows: list[list[str]]
    separator: str = ","
    decimal: str = "."
    end: str = "\n"
    before: list[str] = field(default_factory=list)
    encoding: str = "utf-8"
    trailing: tuple[int, int] = (0, 0)  # empty cells behind header and rows
    last_end: bool = True
    raw: list[Callable[[bytes], bytes]] = field(default_factory=list)

    def data(self) -> bytes:
        """The bytes of the file."""
        lines = [*self.before, self._line(self.header) + self.separator * self.trailing[0]]
        lines += [self._line(row) + self.separator * self.trailing[1] for row in self.rows]
        text = self.end.join(lines) + (self.end if self.last_end else "")
        out = text.encode(self.encoding, "replace")
        for change in self.raw:
            out = change(out)
        return out

    def _line(self, cells: list[str]) -> str:
        quoted = (f'"{cell}"' if self.separator in cell and '"' not in cell else cell for cell in cells)
        return self.separator.join(quoted)


ODD = (
    "", " ", "nan", "NaN", "NA", "n/a", "-", "--", "inf", "-inf", "1e400", "-1e999", "1e-400", "0x1F", "1_000", "1d3",
    "1.#QNAN", "1.#INF", "O.5", "l.5", "1,5", "1.5", "1.234,5", "1,234.5", "1 234", "1'234", "12:30", "2021-12-16",
    "16.12.2021 10:30", "2021-12-16T10:30:00", "=1+1", "=A1", "+A1", "@SUM(A1)", "TRUE", "wahr", "#N/A", "#DIV/0!",
    "####", "5 mm", "5mm", "5 um", "5°", "50%", "<1", ">1", "~1", "1±0.1", "1(2)", "(1)", "'1", "''1", "1e", "1e+",
    "e5", ".", "+", "1..2", "1.2.3", "--1", "+-1", "\u22121", "\u20131", "\uff11\uff12", "\u0967", "²", "1/2", "1;2",
    "1|2", "1\t2", "\"1\"", "\"\"1\"\"", "1 # comment", "1 // c", "x", "None", "null", "1\xa0", "\xa01", "\u200b1",
    "1\u200b", "\ufeff1", "\x1b[31m1", "9" * 30, "-0", "+1", "1.", ".5", "1E5", "1E+05",
    "\uff11",
    "1" + "0" * 320, "0" * 300 + "1", "1." + "0" * 400 + "1",
)  # fmt: skip
UNITS = (
    "mm", "m", "um", "µm", "cm", "in", "inch", "deg", "rad", "mrad", "arcsec", "°", "rev", "N", "kN", "lbf", "s",
    "ms", "min", "h", "degC", "K", "°C", "kg", "g", "", "-", "1", "%", "Mm", "MM", "mM", "meter", "Inch", "mm/s",
    "mm^2", "1e3", "x", "mm mm", "m*m/m", "m m/m", "mm/1", "[mm]", "mm ", "m/1", "N/N", "step", "µ", "mil", "grad",
)  # fmt: skip
OTHERS = ("x", "y", "z", "q1", "q2", "sigma.x", "T", "time", "payload", "dir.q1", "rz", "id", "session")
BYTES = (b"", b"\0", b"\xff", b"\xb5", b'"', b",", b";", b"\n", b"\r", b"\t", b"[", b"]", b"#", b"-", b"e", b"9", b".")


def _place(sheet: Sheet, rng: random.Random) -> tuple[int, int]:
    row = rng.randrange(len(sheet.rows)) if sheet.rows else -1
    return row, rng.randrange(len(sheet.rows[row])) if sheet.rows and sheet.rows[row] else -1


def odd_cell(sheet: Sheet, rng: random.Random) -> None:
    """One cell, or a whole column, says something odd."""
    row, place = _place(sheet, rng)
    text = rng.choice(ODD)
    for k, cells in enumerate(sheet.rows):
        if place >= 0 and place < len(cells) and (k == row or rng.random() < 0.03):
            cells[place] = text


def typed_cell(sheet: Sheet, rng: random.Random) -> None:
    """A slip of the hand within one number."""
    row, place = _place(sheet, rng)
    if place < 0 or not (text := sheet.rows[row][place]):
        return
    at = rng.randrange(len(text))
    put = rng.choice(["", *"0123456789+-.,eE _'\" ;|\t=µO#", "\u00a0", "\u2212", "00", text[at] * 2])
    sheet.rows[row][place] = text[:at] + put + text[at + rng.choice((0, 1, 1)) :]


def marked_cell(sheet: Sheet, rng: random.Random) -> None:
    """A number with thousands separators, another decimal mark, an exponent, a unit, in quotes."""
    row, place = _place(sheet, rng)
    if place < 0:
        return
    text = sheet.rows[row][place]
    other = "," if sheet.decimal == "." else "."
    forms = [text.replace(sheet.decimal, other), f"1{other}{text}", f'"{text}"', f" {text} ", f"{text}e0",
             f"{text}E+00", f"+{text}", f"'{text}", f"{text} mm", f"{text}{sheet.decimal}", f"0{text}",
             f"={text}", f"({text})"]  # fmt: skip
    sheet.rows[row][place] = rng.choice(forms)


def other_mark(sheet: Sheet, rng: random.Random) -> None:
    """One number has the decimal mark of another country."""
    marked = [(row, k) for row in sheet.rows for k, cell in enumerate(row) if sheet.decimal in cell]
    if marked:
        row, k = rng.choice(marked)
        row[k] = row[k].replace(sheet.decimal, "," if sheet.decimal == "." else ".")


def moved_cells(sheet: Sheet, rng: random.Random) -> None:
    """Cells of one row are exchanged, lost or doubled; the others may move along."""
    row, place = _place(sheet, rng)
    if place < 0:
        return
    cells = sheet.rows[row]
    other = rng.randrange(len(cells))
    kind = rng.randrange(6)
    if kind == 0:
        cells[place], cells[other] = cells[other], cells[place]
    elif kind == 1:
        del cells[place]
    elif kind == 2:
        cells.insert(place, cells[other])
    elif kind == 3:
        cells.insert(place, "")
    elif kind == 4:
        cells[:] = cells[:place]
    else:
        cells[:] = ["", *cells[:-1]]


def moved_rows(sheet: Sheet, rng: random.Random) -> None:
    """Rows are exchanged, lost, doubled, emptied, joined, or there is the header again."""
    row, _ = _place(sheet, rng)
    if row < 0:
        return
    other, kind = rng.randrange(len(sheet.rows)), rng.randrange(9)
    if kind == 0:
        sheet.rows[row], sheet.rows[other] = sheet.rows[other], sheet.rows[row]
    elif kind == 1:
        del sheet.rows[row : row + rng.randint(1, 4)]
    elif kind == 2:
        sheet.rows.insert(other, list(sheet.rows[row]))
    elif kind == 3:
        sheet.rows.insert(row, [])
    elif kind == 4:
        sheet.rows[row] = [""] * len(sheet.rows[row])
    elif kind == 5:
        sheet.rows.insert(row, list(sheet.header))
    elif kind == 6:
        sheet.rows.insert(row, ["# " + rng.choice(("comment", "end", "x,y"))])
    elif kind == 7:
        sheet.rows[row] += sheet.rows[other]
    else:
        sheet.rows.insert(row, [rng.choice(ODD)])


def moved_columns(sheet: Sheet, rng: random.Random) -> None:
    """Columns are exchanged (with their names or without), lost, doubled, put in."""
    if not sheet.header:
        return
    a, b, kind = rng.randrange(len(sheet.header)), rng.randrange(len(sheet.header)), rng.randrange(7)
    lines = [sheet.header, *sheet.rows]
    if kind == 4:
        sheet.header.insert(a, rng.choice(("", "note", "x", "sigma.x", "temp")))
    for cells in lines[1:] if kind == 1 else lines if kind != 4 else []:
        if max(a, b) >= len(cells):
            continue
        if kind in (0, 1):
            cells[a], cells[b] = cells[b], cells[a]
        elif kind == 2:
            del cells[a]
        elif kind == 3:
            cells.insert(b, cells[a])
        elif kind == 5:
            cells.insert(a, "" if cells is sheet.header else rng.choice(("", "7", "x")))
        else:
            cells.append(rng.choice(("note", "y", "T [degC]", "time [s]")) if cells is sheet.header else "1")


def renamed_column(sheet: Sheet, rng: random.Random) -> None:
    """A name is spelt otherwise, or is another one."""
    if not sheet.header:
        return
    at = rng.randrange(len(sheet.header))
    name = sheet.header[at]
    k = rng.randrange(len(name) + 1)
    forms = [name.upper(), name.lower(), name.capitalize(), name[:k] + name[k + 1 :], name[:k] + "_" + name[k:],
             f" {name}", f"{name} ", f'"{name}"', name.replace(" [", "["), f"{name}.1",
             name.replace("[", "(").replace("]", ")"), "", rng.choice(sheet.header),
             name.replace("q", "Q"), f"'{name}", name.replace(" [", "_"), rng.choice(OTHERS)]  # fmt: skip
    sheet.header[at] = rng.choice(forms)


def other_unit(sheet: Sheet, rng: random.Random) -> None:
    """A column, or all, in another unit."""
    if not sheet.header:
        return
    at, text = rng.randrange(len(sheet.header)), rng.choice(UNITS)
    for k, name in enumerate(sheet.header):
        if k == at or rng.random() < 0.1:
            bare = name.partition(" [")[0]
            sheet.header[k] = rng.choice((f"{bare} [{text}]", f"{bare}[{text}]", f"{bare} [ {text} ]", bare))


def decimal_commas(sheet: Sheet, rng: random.Random) -> None:
    """As a spreadsheet writes where the decimal mark is a comma; now and then with commas between the cells too."""
    sheet.decimal = ","
    sheet.rows = [[c.replace(".", ",") for c in cells] for cells in sheet.rows]
    sheet.separator = rng.choice(";\t|" if rng.random() < 0.9 else ",")


def other_writing(sheet: Sheet, rng: random.Random) -> None:
    """Another separator, decimal mark, line end or encoding; lines before the header; separators behind the rows."""
    kind = rng.randrange(8)
    if kind == 0:
        sheet.separator = rng.choice(",;\t|")
    elif kind == 1 and sheet.decimal == ".":
        decimal_commas(sheet, rng)
    elif kind == 2:
        sheet.end = rng.choice(("\r\n", "\r", "\n\n", "\r\r\n", "\n\r"))
    elif kind == 3:
        sheet.encoding = rng.choice(("utf-8-sig", "utf-16", "cp1252"))
    elif kind == 4:
        lines = ("# made by hand", "# a,b;c", "", f"sep={sheet.separator}", "Measurement 7", "a;b")
        sheet.before.insert(0, rng.choice(lines))
    elif kind == 5:
        sheet.trailing = rng.choice(((0, 1), (1, 1), (1, 0), (2, 2), (0, 3)))
    elif kind == 6:
        sheet.last_end = False
    else:
        cut = rng.random()
        sheet.raw.append(lambda data: data[: int(len(data) * cut)])


def other_bytes(sheet: Sheet, rng: random.Random) -> None:
    """Some bytes of the file are others."""
    where, cut = rng.random(), rng.choice((0, 1, 1, 2, 10))
    put = rng.choice(BYTES)
    sheet.raw.append(lambda data: data[: int(len(data) * where)] + put + data[int(len(data) * where) + cut :])


MUTATIONS = (odd_cell, typed_cell, marked_cell, other_mark, moved_cells, moved_rows, moved_columns, renamed_column,
             other_unit, other_writing, other_bytes)  # fmt: skip


def mutate(sheet: Sheet, rng: random.Random) -> None:
    """One to three mutations, one after the other; of a fifth of the sheets, written with decimal commas."""
    if rng.random() < 0.2:
        decimal_commas(sheet, rng)
    for _ in range(rng.choice((1, 1, 1, 2, 2, 3))):
        rng.choice(MUTATIONS)(sheet, rng)
