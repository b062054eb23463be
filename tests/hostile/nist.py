"""NIST StRD nonlinear regressions through the fit itself: `python -m tests.hostile.nist` prints a table of digits.

The responses are the readings of one instrument, one row each; nothing but the prediction is another. As in a machine
file, each parameter has a range, here as large as the start is, and the instrument a standard uncertainty, the
certified one.
"""

from __future__ import annotations

import sys
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from types import SimpleNamespace
from typing import Any
from unittest.mock import patch

import numpy as np

from pkmcal_cli.base.rotation import Array
from pkmcal_cli.calibration import predictable as predictable_module
from pkmcal_cli.calibration import residual as residual_module
from pkmcal_cli.calibration.fit import Fit
from pkmcal_cli.calibration.identify import identify
from pkmcal_cli.calibration.problem import Problem
from pkmcal_cli.equilibrium.status import RowStatus
from pkmcal_cli.prediction import Prediction, Rows
from pkmcal_cli.units.measurands import Measurand
from tests.hostile.nist_models import FORMULAS, DataSet

ENOUGH = 4.0  # digits
_LEAST = 1e-9  # of the largest response: no instrument reads to less, not that of Lanczos1
_SHARE = 0.01  # of the residual standard deviation: to less than that ranges have no part in what is found
_STEPS = 500


@dataclass(frozen=True)
class Run:
    """A data set from one of its starts, and what came of it."""

    name: str
    start: int
    digits: float
    fit: Fit

    @property
    def right(self) -> bool:
        """Whether enough digits are those of the certified values."""
        return self.digits >= ENOUGH

    @property
    def honest(self) -> bool:
        """Whether a fit that is not right says so: it has not converged, or tells what the data do not determine."""
        return self.right or self.fit.status != "converged" or bool(self.fit.directions.held.any())


def _model(data: DataSet, start: Array) -> Any:
    """What a fit asks of a machine's model."""
    names = tuple(f"b{k}" for k in range(1, len(start) + 1))
    ranges = np.abs(start)
    parameters = [SimpleNamespace(name=n, range=r, bounds=(-np.inf, np.inf)) for n, r in zip(names, ranges)]
    return SimpleNamespace(
        names=names,
        nominal=start.copy(),
        ranges=ranges,
        parameters=tuple(parameters),
        channels=(SimpleNamespace(measurand=Measurand.DISTANCE, once=np.nan),),
        sensors=(),
        actuators=(),
        gains=np.zeros(0),
        length=1.0,
        overdetermined=False,
        correlated=(),
        effects=(),
        topology=SimpleNamespace(drives=()),
        exact=SimpleNamespace(ropes=False),
        data=data,
    )


def _predict(
    model: Any, values: Array, rows: Rows, request: Any, start: Any = None, receive: Any = None
) -> Prediction:
    """Responses as readings (N, 1); rows without a finite number are not solved."""
    y, jacobian = model.data.predicted(values)
    good = np.isfinite(y) & np.isfinite(jacobian).all(axis=1)
    count = len(y)
    return Prediction(
        values=np.where(good, y, np.nan)[:, None],
        status=np.where(good, RowStatus.SOLVED, RowStatus.NOT_CONVERGED),
        state=None,  # type: ignore[arg-type]  # no mechanism has one here
        jacobian=jacobian[:, None, :],
        by_drive=np.zeros((count, 1, 0)),
        forces=None,
        energy=None,
        tension=None,
        slack={},
        misfit=np.zeros(count),
        steps=0,
    )


@contextmanager
def _regression() -> Iterator[None]:
    """Predictions are those of the formulas, and no drive has errors."""
    unknown = lambda problem, *_: np.full((len(problem), 0), np.nan)  # noqa: E731
    nowhere = patch.object(predictable_module, "errors_at_poses", unknown)
    with patch.object(residual_module, "predict_with_derivatives", _predict), nowhere:
        yield


def fitted(data: DataSet, start: Array) -> Fit:
    """The fit of all parameters from a start (p,)."""
    model, count = _model(data, start), len(data.y)
    sigma = max(_SHARE * data.deviation, _LEAST * float(np.abs(data.y).max()))
    problem = Problem(
        model=model,
        rows=Rows.at(np.zeros((count, 0))),
        readings=data.y[:, None],
        sigma=np.full((count, 1), sigma),
        drive_sigma=np.zeros((count, 0)),
        measured=np.ones((count, 1), dtype=bool),
    )
    with _regression():
        return identify(problem, model.names, iterations=_STEPS)


def run(name: str, start: int) -> Run:
    """One data set from start 0 or 1."""
    data = DataSet.read(name)
    fit = fitted(data, data.starts[start])
    return Run(name, start + 1, data.digits(fit.values), fit)


def main() -> int:
    """The table, and how many runs are right."""
    runs = [run(name, start) for name in FORMULAS for start in (0, 1)]
    for r in runs:
        note = "" if r.right else f"  {'told' if r.honest else 'NOT TOLD'}"
        steps = f"{r.fit.iterations:4d} steps"
        print(f"{r.name:9s} start {r.start}: {r.digits:5.1f} digits, {steps}, {r.fit.status} ({r.fit.stopped}){note}")
    right = sum(r.right for r in runs)
    honest = all(r.honest for r in runs)
    print(f"{right} of {len(runs)} runs with at least {ENOUGH:g} digits; the others told: {honest}")
    return int(not honest)


if __name__ == "__main__":
    sys.exit(main())
