"""Four belts that measure themselves, a length forgotten in each, and upper drums that are too small. SI."""

from __future__ import annotations

import csv
import re
from pathlib import Path

from .self_measured_tables import SENSING, Table, belt_places, cells

BELTS = ("TL", "TR", "BL", "BR")


def forgotten(seed: int, length: float, upper: float = 0.0) -> Table:
    """The router with `length` (m) more of every belt out at its stop, and upper drums larger by a share `upper`."""
    machine, (places, partner) = SENSING["belt-router"], belt_places()
    zeros = tuple(f"zero{belt}" for belt in BELTS)
    off = (*((name, length) for name in zeros), ("Rtop", upper * machine.nominal["Rtop"]))
    return Table(
        machine=machine,
        places=places,
        partner=partner,
        error_seed=1000 + seed,
        noise_seed=2000 + seed,
        forgotten=off,
        exact=zeros,
    )


def without_zeros(text: str) -> str:
    """A machine file in which nobody thought of the belts that are out at their stops."""
    text = re.sub(r'  "zero\{i\}":.*\n', "", text)
    return re.sub(r'zero: "zero\{[ij]\}"', "zero: 250 mm", text)


def write(table: Table, file: Path) -> None:
    """The measurement file."""
    header, rows = cells(table)
    with file.open("w", newline="", encoding="utf-8") as out:
        csv.writer(out, lineterminator="\n").writerows([header, *rows])
