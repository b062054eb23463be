"""Correction."""

from __future__ import annotations

import os
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
import pandas as pd

from pkmcal_cli.base.listener import Record
from pkmcal_cli.base.plural import count
from pkmcal_cli.pictures.picture import Picture
from pkmcal_cli.workflow.correct import Corrected, CorrectionRequest, correction, correction_drawn

from .computing import computing
from .machine import Machine, load, number
from .result import Result, messages_of
from .tables import Parameters, Table, frame_of, parameters_of, source_of


@dataclass(frozen=True, eq=False, kw_only=True, repr=False)
class Correction(Result):
    """Set values that bring the tool point to its targets."""

    outcome: Corrected  # not stable
    asked: CorrectionRequest  # not stable
    values: dict[str, Any]  # not stable: use `json`

    @property
    def ok(self) -> bool:
        """Whether all targets of a table have set values."""
        return not self.outcome.code

    @property
    def verdict(self) -> str:
        """How many targets have set values."""
        return f"{self.values['n_corrected']} of {count(self.values['n_targets'], 'target')} corrected"

    @property
    def table(self) -> pd.DataFrame:
        """Set values of the targets, with errors, forces and their uncertainties; `simulate` takes it as poses."""
        cells = self.outcome.cells
        return frame_of(self.outcome.columns, cells or [np.zeros(0)] * len(self.outcome.columns))

    @property
    def errors(self) -> pd.DataFrame:
        """Errors of the tool point before and after, and how sure they are, rms and max in `unit`, by kind."""
        rows = []
        for kind, figures in self.values["errors"].items():
            row: dict[str, Any] = {"kind": kind}
            for figure in ("before", "u_before", "after", "u"):
                row |= {f"{name}_{figure}": number(figures[figure][name]) for name in ("rms", "max")}
            rows.append(row | {"unit": figures["unit"]})
        return pd.DataFrame(rows).set_index("kind") if rows else pd.DataFrame(rows)

    @property
    def failed(self) -> pd.DataFrame:
        """Targets without set values: number, reason."""
        rows = sorted(self.outcome.report.lost.reasons.items())
        return pd.DataFrame([(k + 1, why) for k, why in rows], columns=["target", "reason"])

    def json(self) -> dict[str, Any]:
        """What `pkmcal correct --json` says, without provenance."""
        return dict(self.values)

    def _picture(self) -> Picture:
        return correction_drawn(self.asked, self.outcome)


def correct(
    machine: str | os.PathLike[str] | Machine,
    targets: Table | None = None,
    *,
    grid: str | None = None,
    parameters: Parameters | None = None,
    at: str | Mapping[str, float | str] | None = None,
    redundant: str = "min-force",
) -> Correction:
    """Which set values bring the TCP to these targets? As `pkmcal correct`.

    at: circumstances, `{"T": "23 +- 0.5"}`; redundant: what redundant drives are used for. Raises PkmcalError.
    """
    known = load(machine)
    stated = ",".join(f"{name}={value}" for name, value in at.items()) if isinstance(at, Mapping) else at
    request = CorrectionRequest(
        machine=known.file, targets=None if targets is None else source_of(targets, "targets"), grid=grid,
        parameters=parameters_of(parameters), at=stated, redundant=redundant,
    )  # fmt: skip
    record = Record()
    with computing():
        corrected = correction(request, record, known.loaded)
        result = corrected.report.json() | {"at": stated}
    return Correction(machine=known, outcome=corrected, asked=request, values=result, **messages_of(record))
