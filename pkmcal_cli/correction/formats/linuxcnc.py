"""Tables of LinuxCNC: COMP_FILE of a joint, with COMP_FILE_TYPE = 1.

A line holds the commanded position and what is added to it when the joint moves forward, and in reverse; in machine
units, ascending, at most 256 lines. Between lines the control interpolates, outside it keeps the first and last one.
Reading ends at the first line that is none of three numbers, so remarks stand at the end.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from pkmcal_cli.correction.drive_tables import Digits, DriveTable, drafted, drive_tables
from pkmcal_cli.correction.export_case import Draft, ExportCase, Format


def _digits(case: ExportCase, drive: int) -> Digits:
    unit = case.unit(drive)
    return Digits(position=unit.to_si(1e-3), correction=unit.to_si(1e-6))


def _lines(case: ExportCase, drive: int, table: DriveTable) -> list[str]:
    unit = case.unit(drive)
    rows = zip(table.knots, table.forward, table.reverse, strict=True)
    return [f"{unit.from_si(k):.3f} {unit.from_si(f):.6f} {unit.from_si(r):.6f}" for k, f, r in rows]


def _draft(case: ExportCase) -> Draft:
    tables = drive_tables(case, lambda a: _digits(case, a))

    def texts(remarks: Sequence[str]) -> Mapping[str, str]:
        out = {}
        for a, table in zip(case.drives, tables, strict=True):
            comments = [
                f"drive {case.name(a)}, unit {case.unit(a).text}; [JOINT_n] COMP_FILE_TYPE = 1",
                "position, added in forward motion, added in reverse motion; LinuxCNC reads up to this line",
                *remarks,
            ]
            out[case.name(a)] = "\n".join([*_lines(case, a, table), *(f"# {line}" for line in comments), ""])
        return out

    return drafted(case, tables, texts)


LINUXCNC = Format(
    keyword="linuxcnc",
    title="tables of single drives, LinuxCNC COMP_FILE",
    sources=(
        "https://linuxcnc.org/docs/stable/html/config/ini-config.html",
        "https://github.com/LinuxCNC/linuxcnc/blob/master/src/emc/motion/usrmotintf.cc",
    ),
    suffix=".comp",
    draft=_draft,
    parts=True,
)
