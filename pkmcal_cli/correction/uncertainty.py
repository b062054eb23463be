"""How sure corrected poses and forces are: parameters, held ones included, conditions, and what no effect explains."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace

import numpy as np

from pkmcal_cli.base.rotation import Array
from pkmcal_cli.correction.set_values import Aim
from pkmcal_cli.correction.strained_pose import LoadedTool, StrainedPose
from pkmcal_cli.prediction import Rows, WarmStart
from pkmcal_cli.prediction.unknown_sides import side_sigma

_WEAK = 0.5  # of the prior's standard uncertainty: data that leave a direction no surer than so hardly determine it


@dataclass(frozen=True, kw_only=True)
class KnownTo:
    """What is known how well: parameters by a covariance (p, p) and halves of their ranges (p,), SI.

    conditions: standard uncertainty of columns of the rows; unexplained: that of a position (m) and of an orientation
    (rad), of each coordinate, by what the calibration left beyond noise.
    """

    names: tuple[str, ...]
    covariance: Array
    half_ranges: Array
    conditions: Mapping[str, float] = field(default_factory=dict)
    unexplained: tuple[float, float] = (0.0, 0.0)


@dataclass(frozen=True, kw_only=True)
class Spread:
    """Standard uncertainties of tool coordinates (N, h) and of forces (N, A).

    weak (N,): share of the variance of the position that comes from directions of parameters which the data hardly
    determine.
    """

    tool: Array
    force: Array
    weak: Array


def spread(tool: LoadedTool, values: Array, aim: Aim, there: StrainedPose, rows: Rows, known: KnownTo) -> Spread:
    """Of a pose that was predicted for `rows` at parameter values (P,)."""
    start = there.prediction.start
    by = tool.at(values, rows, aim.targets, known.names, start)
    variances = [_carried(j, known.covariance) for j in (by.by_tool, by.by_force)]
    weak = _carried(by.by_tool, _hardly_determined(known)) / tool.sizes**2
    whole = variances[0] / tool.sizes**2
    for name, std in known.conditions.items():
        ends = [tool.at(values, _changed(rows, name, s * std), aim.targets, "", start) for s in (1.0, -1.0)]
        variances[0] += (0.5 * (ends[0].tool - ends[1].tool)) ** 2
        variances[1] += (0.5 * (ends[0].force - ends[1].force)) ** 2
    for k, variance in enumerate(_by_unknown_sides(tool, values, aim, rows, start)):
        variances[k] += variance
    for k, by_shape in enumerate(tool.by_unknown_shapes(values, rows, aim.targets, there.prediction)):
        variances[k] += (by_shape**2).sum(axis=2)
    variances[0] = variances[0] + np.where(tool.turning, known.unexplained[1], known.unexplained[0]) ** 2
    total = whole.sum(axis=1)
    share = np.divide(weak.sum(axis=1), total, out=np.zeros(len(total)), where=total > 0)
    return Spread(tool=np.sqrt(variances[0]), force=np.sqrt(variances[1]), weak=share)


def _by_unknown_sides(
    tool: LoadedTool, values: Array, aim: Aim, rows: Rows, start: WarmStart
) -> tuple[Array, Array] | tuple[()]:
    """Variances of the tool (N, h) and of forces (N, A) in rows that come from no stated side; none without such."""
    sizes = {name: abs(float(value)) for name, value in zip(tool.machine.names, values, strict=True)}
    travel = side_sigma(tool.machine, rows, sizes)
    if travel is None:
        return ()
    by = tool.at(values, rows, aim.targets, "readings", start)
    variance = (travel / tool.machine.gains)[:, None] ** 2
    return (by.by_tool**2 * variance).sum(axis=2), (by.by_force**2 * variance).sum(axis=2)


def _carried(jacobian: Array, covariance: Array) -> Array:
    """Variances (N, c) of what has a Jacobian (N, c, p)."""
    return np.asarray(np.maximum(np.einsum("ncp,pq,ncq->nc", jacobian, covariance, jacobian), 0.0))


def _hardly_determined(known: KnownTo) -> Array:
    """The part (p, p) of the covariance in directions that the data leave nearly as unsure as the ranges."""
    scale = np.where(known.half_ranges > 0, known.half_ranges, 1.0)
    value, vector = np.linalg.eigh(known.covariance / np.outer(scale, scale))
    kept = np.where(value > _WEAK**2, value, 0.0)
    return np.asarray((vector * kept) @ vector.T * np.outer(scale, scale))


def _changed(rows: Rows, name: str, by: float) -> Rows:
    return replace(rows, columns={**rows.columns, name: rows.columns[name] + by})
