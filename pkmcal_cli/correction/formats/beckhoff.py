"""Lists of TwinCAT CNC (TF5200): leadscrew error compensation, `kw.ssfk`, of an axis.

Positions and values are whole multiples of 0.1 um (rotary axes: 0.0001 deg) with `unit` 1. A value is the deviation of
the axis, actual less set position, which the control takes off again; between positions it interpolates.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from pkmcal_cli.correction.drive_tables import Digits, DriveTable, drafted, drive_tables
from pkmcal_cli.correction.export_case import Draft, ExportCase, Format
from pkmcal_cli.units.unit_text import parse_unit

_LARGEST = 2**31 - 1


def _count(case: ExportCase, drive: int) -> float:
    """What the control counts by, SI."""
    rotary = case.model.actuators[drive].dimension == "angle"
    return parse_unit("deg").to_si(1e-4) if rotary else 1e-7


def _entries(case: ExportCase, number: int, drive: int, table: DriveTable) -> list[tuple[str, object]]:
    count = _count(case, drive)
    low, step = round(table.low / count), round(table.step / count)
    values = {"pos": -np.round(table.forward / count), "neg": -np.round(table.reverse / count)}
    columns = values if case.sided else {"pos": values["pos"]}
    numbers = [low, step, *(v for column in columns.values() for v in column)]
    if max(abs(float(v)) for v in numbers) > _LARGEST:
        message = f"a number of drive `{case.name(drive)}` is more than 32 bits hold"
        raise case.refuse("beckhoff", message, "another format holds it, for example `--as csv`")
    head = [
        ("kopf.achs_nr", number),
        ("kopf.log_achs_name", case.name(drive)),
        ("kw.ssfk.unit", 1),
        ("kw.ssfk.interval", step),
        ("kw.ssfk.kw_startpos", low),
        ("kw.ssfk.kw_nr_max", len(table.forward)),
        ("kw.ssfk.bilateral", int(case.sided)),
        ("kw.ssfk.modulo", 0),
    ]
    return head + [
        (f"kw.ssfk.table[{i}].{name}", int(v)) for name, column in columns.items() for i, v in enumerate(column)
    ]


def _draft(case: ExportCase) -> Draft:
    digits = {int(a): _count(case, int(a)) for a in case.drives}
    tables = drive_tables(case, lambda a: Digits(position=digits[int(a)], correction=digits[int(a)]))
    entries = {
        case.name(a): _entries(case, k + 1, int(a), t)
        for k, (a, t) in enumerate(zip(case.drives, tables, strict=True))
    }

    def texts(remarks: Sequence[str]) -> Mapping[str, str]:
        header = [
            "positions and values in 0.1 um (rotary: 0.0001 deg); value: actual less set position",
            "set kopf.achs_nr to the number of the axis; lr_param.ssfk 1 switches the compensation on",
            *remarks,
        ]
        comments = [f"# {line}" for line in header]
        return {
            name: "\n".join([*comments, *(f"{key:<32}{value}" for key, value in lines), ""])
            for name, lines in entries.items()
        }

    return drafted(case, tables, texts)


BECKHOFF = Format(
    keyword="beckhoff",
    title="tables of single drives, TwinCAT CNC leadscrew error compensation",
    sources=(
        "https://infosys.beckhoff.com/content/1033/tf5200_axis_compensation/308683659.html",
        "https://infosys.beckhoff.com/content/1033/tf5200_axis_compensation/308687883.html",
        "https://infosys.beckhoff.com/content/1033/tf5200_axis_compensation_parameters/113373067.html",
        "https://infosys.beckhoff.com/content/1033/tf5200_axis_compensation_parameters/113439115.html",
    ),
    suffix=".lis",
    draft=_draft,
    parts=True,
)
