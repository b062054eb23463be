"""Tables of LinuxCNC: COMP_FILE of a joint, with COMP_FILE_TYPE = 1.

A line holds the commanded position and what is added to it when the joint moves forward, and in reverse; in machine
units, ascending, at most 256 lines. Between lines the control interpolates, outside it keeps the first and last one.
Reading ends at the first line that is none of three numbers, so remarks stand at the end.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from pkmcal_cli.correction.drive_tables import decimal_digits, decimals, drafted, drive_tables
from pkmcal_cli.correction.export_case import Draft, ExportCase, Format


def _draft(case: ExportCase) -> Draft:
    tables = drive_tables(case, decimal_digits(case))

    def texts(remarks: Sequence[str]) -> Mapping[str, str]:
        out = {}
        for a, table in zip(case.drives, tables, strict=True):
            comments = [
                f"drive {case.name(a)}, unit {case.unit(a).text}; [JOINT_n] COMP_FILE_TYPE = 1",
                "position, added in forward motion, added in reverse motion; LinuxCNC reads up to this line",
                *remarks,
            ]
            lines = [" ".join(row) for row in decimals(case, a, table)]
            out[case.name(a)] = "\n".join([*lines, *(f"# {line}" for line in comments), ""])
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
