"""What all results have."""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import pandas as pd

from pkmcal_cli.base.listener import Record
from pkmcal_cli.calibration.problem import Problem
from pkmcal_cli.calibration.residual import Evaluation
from pkmcal_cli.pictures.picture import Picture

from .machine import Machine
from .tables import frame_of

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_SHOWN = 5  # warnings


@dataclass(frozen=True, eq=False, kw_only=True, repr=False)
class Result(ABC):
    """A result, which nothing changes: tables are made anew whenever they are asked for.

    machine: of which it is; notes, warnings: what there is to say of the inputs.
    """

    machine: Machine
    notes: tuple[str, ...]
    warnings: tuple[str, ...]

    @property
    @abstractmethod
    def verdict(self) -> str:
        """What came out, in a word or a line."""

    @property
    @abstractmethod
    def ok(self) -> bool:
        """Whether the command would end with 0."""

    @property
    @abstractmethod
    def table(self) -> pd.DataFrame:
        """Rows of the result, with units in the names of columns."""

    @abstractmethod
    def json(self) -> dict[str, Any]:
        """What `--json` says, without provenance."""

    @abstractmethod
    def _picture(self) -> Picture:
        """What `plot` draws."""

    def plot(self) -> Figure:
        """The picture that `--plot` writes, as a matplotlib Figure, with `savefig`."""
        return self._picture().figure()

    def _repr_html_(self) -> str:
        """As notebooks show it."""
        import html

        return f"<pre>{html.escape(repr(self))}</pre>"

    def __repr__(self) -> str:
        lines = [f"{type(self).__name__} of {self.machine.name}: {self.verdict}"]
        lines += [f"warning: {text}" for text in self.warnings[:_SHOWN]]
        if (more := len(self.warnings) - _SHOWN) > 0:
            lines.append(f"... and {more} more warnings")
        return "\n".join(lines)


def messages_of(record: Record) -> dict[str, tuple[str, ...]]:
    """What a work has said, as a result has it."""
    return {"notes": tuple(record.lines), "warnings": (*record.warnings, *record.failures)}


def residual_frame(problem: Problem, evaluation: Evaluation) -> pd.DataFrame:
    """Measured minus predicted, a column for each channel that was measured; nan where a row has no part in the fit."""
    import numpy as np

    errors = np.where(problem.measured, evaluation.residual, np.nan)
    columns = [k for k in range(errors.shape[1]) if problem.measured[:, k].any()]
    channels = problem.model.channels
    return frame_of([(channels[k].name, channels[k].unit) for k in columns], [errors[:, k] for k in columns])
