"""Tables of single drives as CSV: for controls whose own form is not public.

Columns: `drive`; `unit` of the other three; `position`, the set value of the nominal machine; `forward` and `reverse`,
what is added to it when it is approached towards larger and towards smaller readings. Between positions of a drive
interpolate straight; outside of them keep the first and the last row. The format is defined in docs/correct.md.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from pkmcal_cli.correction.drive_tables import decimal_digits, decimals, drafted, drive_tables
from pkmcal_cli.correction.export_case import Draft, ExportCase, Format


def _draft(case: ExportCase) -> Draft:
    tables = drive_tables(case, decimal_digits(case))

    def texts(remarks: Sequence[str]) -> Mapping[str, str]:
        lines = [f"# {line}" for line in remarks]
        lines.append("drive,unit,position,forward,reverse")
        for a, table in zip(case.drives, tables, strict=True):
            lines += [",".join((case.name(a), case.unit(a).text, *row)) for row in decimals(case, a, table)]
        return {"": "\n".join([*lines, ""])}

    return drafted(case, tables, texts)


CSV = Format(
    keyword="csv",
    title="tables of single drives, CSV",
    sources=("https://www.rfc-editor.org/rfc/rfc4180",),
    suffix=".csv",
    draft=_draft,
)
