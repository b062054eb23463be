"""Four belts that measure themselves: 0.15 m forgotten in each, and upper drums that are 0.4 % too small. SI units.

The truth is `tests.truth.belts`; motors are read to 1e-4 of a revolution, the tape to 0.1 mm.
"""

from __future__ import annotations

import csv
import io
from dataclasses import replace
from pathlib import Path

import numpy as np

from tests.truth.forgotten import BELTS, forgotten, without_zeros
from tests.truth.pinned import Array
from tests.truth.self_measured_tables import Table, cells

from .look_alike import LookAlike

MACHINE = Path(__file__).resolve().parents[3] / "machines" / "belt-router.yaml"
LENGTH, UPPER = 0.15, -0.004
FRESH = 30


def forgotten_belts(seed: int) -> LookAlike:
    """The campaign of a seed."""
    table = forgotten(seed, LENGTH, UPPER)
    rng = np.random.default_rng([seed, 3])
    other = replace(
        table, places=rng.uniform([0.6, 0.5], [2.4, 1.7], (FRESH, 2)), partner=_pairs(), noise_seed=7000 + seed
    )
    exact = _Exact(**{f: getattr(other, f) for f in other.__dataclass_fields__})
    true = {n: v for n, v in table.planted().items() if n not in {f"zero{belt}" for belt in BELTS}}
    return LookAlike(
        machine=without_zeros(MACHINE.read_text(encoding="utf-8")),
        table=_text(table, 4),
        causes=(("zero@all",), ("release Rtop",)),
        declared="parameters: {Rtop: {identify: true}}\neffects: {zero@all: {o: {value: 150 mm, range: 5 mm}}}\n",
        fresh=_text(other, 4),
        exact=_text(exact, 9),
        values=true | {"zero@all.o": LENGTH},
    )


class _Exact(Table):
    """The same without noise."""

    @property
    def noise(self) -> Array:  # type: ignore[override]
        return np.zeros((len(self.places), len(self.machine.drives) + len(self.machine.channels)))


def _pairs() -> Array:
    """Partners (30,) of the tape: of the last ten places, each to the fifth after it."""
    return np.concatenate([np.full(FRESH - 10, -1), FRESH - 10 + (np.arange(10) + 5) % 10])


def _text(table: Table, digits: int) -> str:
    """The table, of which the tape's numbers keep one digit and the motors' some."""
    header, rows = cells(table)
    tape = header.index("tape [mm]")
    kept = [
        [_digits(c, 1 if k == tape and digits < 9 else digits) if 0 < k <= tape else c for k, c in enumerate(row)]
        for row in rows
    ]
    out = io.StringIO()
    csv.writer(out, lineterminator="\n").writerows([header, *kept])
    return out.getvalue()


def _digits(cell: str, digits: int) -> str:
    return f"{float(cell):.{digits}f}" if cell else ""
