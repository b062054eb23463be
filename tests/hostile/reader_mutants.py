"""Mutants of the reader of tables: the fuzz with its plain second reader kills them."""

from __future__ import annotations

from tests.hostile.mutant_kinds import Mutant

_FUZZ = "tests/test_fuzz.py::test_no_traceback_and_no_silent_shift[tables-0]"
_NOT = "if not is_number(cell, decimal)"

READER: tuple[Mutant, ...] = (
    Mutant("csv_files/cell_values.py", ' or (decimal == "," and "." in text)', "", _FUZZ),
    Mutant("csv_files/dialect.py", "(?:[0-9]+,?[0-9]*|,[0-9]+)", "(?:[0-9]+[.,]?[0-9]*|[.,][0-9]+)", _FUZZ),
    Mutant("csv_files/cells.py", f"{_NOT}:", f"{_NOT} and not is_number(cell, '.'):", _FUZZ),
    Mutant("csv_files/cells.py", "if value - value != 0.0:", "if value != value:", _FUZZ),
    Mutant(
        "csv_files/dialect.py",
        "_without_blanks_in_cells(_trials(header, rows, separators))",
        "_trials(header, rows, separators)",
        "tests/test_csv_table.py::test_blanks_within_cells_part_nothing_where_tabs_do",
    ),
)
