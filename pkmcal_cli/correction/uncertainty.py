"""How sure corrected poses and forces are: parameters, held ones included, conditions, and what no effect explains."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace

import numpy as np

from pkmcal_cli.base.rotation import Array, small_motions
from pkmcal_cli.correction.set_values import Aim
from pkmcal_cli.correction.strained_pose import LoadedTool, StrainedPose
from pkmcal_cli.model.commanded import per_command
from pkmcal_cli.prediction import Rows, WarmStart
from pkmcal_cli.prediction.unknown_sides import side_sigma

_WEAK = 0.5  # of the prior's standard uncertainty: data that leave a direction no surer than so hardly determine it

_NO_TURN = 1e-9  # share of the largest motion of points: what turns points on a line about it moves none


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
    determine. apart (N, h): uncertainties of positions to each other, but for a shift and a turn of all of them; nan of
    orientations, and where positions are too few or not wholly held.
    """

    tool: Array
    force: Array
    weak: Array
    apart: Array


def spread(tool: LoadedTool, values: Array, aim: Aim, there: StrainedPose, rows: Rows, known: KnownTo) -> Spread:
    """Of a pose that was predicted for `rows` at parameter values (P,)."""
    start = there.prediction.start
    by = tool.at(values, rows, aim.targets, known.names, start)
    variances = [_carried(j, known.covariance) for j in (by.by_tool, by.by_force)]
    weak = _carried(by.by_tool, _hardly_determined(known)) / tool.sizes**2
    whole, common = variances[0] / tool.sizes**2, variances[0] - _apart(tool, aim, by.by_tool, known.covariance)
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
    apart = np.sqrt(np.maximum(variances[0] - common, 0.0))
    return Spread(tool=np.sqrt(variances[0]), force=np.sqrt(variances[1]), weak=share, apart=apart)


def _apart(tool: LoadedTool, aim: Aim, by_tool: Array, covariance: Array) -> Array:
    """Variances (N, h) of positions by parameters, by_tool (N, h, p), less what moves all as one rigid body."""
    out, axes = np.full(by_tool.shape[:2], np.nan), 2 if tool.machine.topology.planar else 3
    columns = [tool.held.index(name) for name in "xyz"[:axes] if name in tool.held]
    rows, freedoms = np.nonzero(np.isfinite(by_tool).all(axis=(1, 2)))[0], axes * (axes + 1) // 2
    if len(columns) < axes or len(rows) * axes < 2 * freedoms:
        return out
    motions = small_motions(aim.targets[rows][:, columns])
    basis, sizes, _ = np.linalg.svd(motions.reshape(-1, freedoms), full_matrices=False)
    rigid = basis[:, sizes > _NO_TURN * sizes[0]]
    moved = by_tool[rows][:, columns].reshape(len(basis), -1)
    left = moved - rigid @ (rigid.T @ moved)
    out[np.ix_(rows, np.array(columns))] = _carried(left[:, None], covariance).reshape(len(rows), axes)
    return out


def _by_unknown_sides(
    tool: LoadedTool, values: Array, aim: Aim, rows: Rows, start: WarmStart
) -> tuple[Array, Array] | tuple[()]:
    """Variances of the tool (N, h) and of forces (N, A) in rows that come from no stated side; none without such."""
    sizes = {name: abs(float(value)) for name, value in zip(tool.machine.names, values, strict=True)}
    moved = side_sigma(tool.machine, rows, sizes)
    if moved is None:
        return ()
    by = tool.at(values, rows, aim.targets, "readings", start)
    variance = (moved / per_command(tool.machine))[:, None] ** 2
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
