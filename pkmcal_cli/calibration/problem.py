"""What was measured, bound to a model: rows, readings, their uncertainties."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from pkmcal_cli.base.lean import some_rows
from pkmcal_cli.base.rotation import Array
from pkmcal_cli.calibration.held_datum import HeldDatum
from pkmcal_cli.calibration.identifiability import UNSEEN
from pkmcal_cli.calibration.nominal_poses import NominalPoses
from pkmcal_cli.calibration.prior import Prior
from pkmcal_cli.calibration.session_frames import SessionFrames
from pkmcal_cli.calibration.whitening import Clusters
from pkmcal_cli.model.commanded import drive_sigma, forced, per_command
from pkmcal_cli.model.model import Model
from pkmcal_cli.model.parts import Channel
from pkmcal_cli.prediction import Method, Rows, bounds_of, predict
from pkmcal_cli.units.measurands import Measurand


@dataclass(frozen=True, kw_only=True)
class Problem:
    """A model and what was measured: readings (N, C), their sigma (N, C) and that of the drives as travel (N, A).

    `measured` (N, C): cells with a number and a known sigma, the only ones that a fit uses. `prior`: what is known
    besides; `unseen`: singular value below which a direction is not seen; `weight` (N, C): of the whitened readings,
    by a robust fit, None for 1; `copies`: groups of rows that are the same to the last digit, of which the first alone
    is measured; `left_out`: channels of what was measured once that are not used; `method` of all predictions;
    `side_sigma` (N, A): of the drives' travel, or of commanded forces, where the side of approach is unknown, None for
    0; `poses`: nominal ones, those that are known of the same rows, else found where they are asked for; `datum`: what
    is held, and moves along; `frames`: those that are eliminated from a fit.
    """

    model: Model
    rows: Rows
    readings: Array
    sigma: Array
    drive_sigma: Array
    measured: NDArray[np.bool_]
    prior: Prior | None = None
    unseen: float = UNSEEN
    weight: Array | None = None
    copies: tuple[tuple[int, ...], ...] = ()
    left_out: tuple[int, ...] = ()
    method: Method = "exact"
    side_sigma: Array | None = None
    poses: NominalPoses | None = None
    datum: HeldDatum | None = None
    frames: SessionFrames | None = None

    def __post_init__(self) -> None:
        if self.poses is None or not self.poses.holds_for(self.model, self.rows):
            object.__setattr__(self, "poses", NominalPoses(self.model, self.rows))

    def __len__(self) -> int:
        return len(self.readings)

    def beside(self, names: Sequence[str], ranges: Array | None = None) -> Array | None:
        """By what parameters are off (p, g), in ranges (P,), where one of the datum is; None where none is held."""
        if self.datum is None:
            return None
        return self.datum.in_ranges(self.model, names, self.model.ranges if ranges is None else ranges)

    def nominal_at(self, values: Array) -> Array:
        """Nominal values (P,) of the machine as the datum has it at values (P,)."""
        return self.model.nominal if self.datum is None else self.datum.nominal(self.model, values)

    @property
    def eliminated(self) -> tuple[str, ...]:
        """Names of parameters that fits eliminate."""
        return () if self.frames is None else self.frames.names

    def unknowns(self, selected: Sequence[str]) -> int:
        """Number of parameters that a fit of some determines, together with those that it eliminates."""
        return len(selected) + len(self.eliminated)

    @property
    def count(self) -> int:
        """Number of measured values."""
        return int(self.measured.sum())

    @property
    def nominal_poses(self) -> dict[str, Array]:
        """TCP coordinates (N,) that move independently, at nominal parameters; where these fail, drive readings."""
        model, names = self.model, self.model.independent_coordinates
        if names and (poses := self._nominal.of(names)):
            return poses
        held = [a for a, d in enumerate(model.topology.drives) if not d.force_controlled and not d.redundant]
        return {model.actuators[a].name: self.rows.readings[:, a] for a in held}

    @property
    def _nominal(self) -> NominalPoses:
        assert self.poses is not None
        return self.poses

    @property
    def bounds(self) -> Array:
        """Bounds (P, 2) of the parameters, SI."""
        return bounds_of(self.model, self.rows.columns)

    @property
    def reading_sigma(self) -> Array:
        """Standard uncertainty of what drives are commanded (N, A): of their readings, or of forces."""
        both = self.drive_sigma if self.side_sigma is None else np.hypot(self.drive_sigma, self.side_sigma)
        return np.asarray(both / per_command(self.model))

    @property
    def once(self) -> list[int]:
        """Channels of what was measured once, and is used."""
        return [k for k, c in enumerate(self.model.channels) if not np.isnan(c.once) and k not in self.left_out]

    @property
    def joining(self) -> NDArray[np.intp]:
        """Channels that join two rows."""
        return np.array([k for s in self.model.sensors if s.kind.joins for k in s.channels], dtype=np.intp)

    @cached_property
    def clusters(self) -> Clusters:
        """Rows that measurements join."""
        partner, joining = self.rows.partner, self.joining
        if partner is None or not len(joining):
            return Clusters.of(len(self), None)
        return Clusters.of(len(self), np.where(self.measured[:, joining].any(axis=1), partner, -1))

    @cached_property
    def noise(self) -> Array:
        """Covariance (N, C, C) of the readings by themselves; 1 where nothing was measured."""
        size = np.where(self.measured, self.sigma, 1.0)
        out = np.zeros((*size.shape, size.shape[1]))
        channels = np.arange(size.shape[1])
        out[:, channels, channels] = size**2
        for a, b, share in self.model.correlated:
            both = self.measured[:, a] & self.measured[:, b]
            out[:, a, b] = out[:, b, a] = np.where(both, share * size[:, a] * size[:, b], 0.0)
        return out

    def without(self, rows: Collection[int] | NDArray[np.intp]) -> Problem:
        """The same table with nothing measured in some rows, nor to them; what was measured once goes to another."""
        if not len(rows):
            return self
        gone = np.zeros(len(self) + 1, dtype=bool)  # the last entry answers for rows without partner
        gone[np.fromiter(rows, dtype=np.intp)] = True
        measured = self.measured & ~gone[:-1, None]
        if self.rows.partner is not None:
            measured[np.ix_(gone[self.rows.partner], self.joining)] = False
        part = replace(self, measured=measured)
        return usable(part) if self.measured[:, self.once].any() else part

    def leaving_out(self, channels: Collection[int]) -> Problem:
        """The same table without what was measured once of these channels alone: all others of that kind are used."""
        left_out = tuple(sorted(channels))
        if left_out == self.left_out:
            return self
        gone, readings, measured = list({*left_out, *self.left_out}), self.readings.copy(), self.measured.copy()
        readings[:, gone], measured[:, gone] = np.nan, False
        return usable(replace(self, readings=readings, measured=measured, left_out=left_out))

    def take(self, rows: NDArray[np.intp]) -> Problem:
        """Some rows; what joins them to others is lost, what was measured once stays."""
        return usable(self.part(rows))

    def moved(self, errors: Array) -> Rows:
        """Its rows with errors (N, A) of what drives are commanded: of readings, or forces of force-controlled ones."""
        by_force, names = forced(self.model), self.model.drive_names
        pushed = {f"push.{names[a]}": errors[:, a] for a in np.nonzero(by_force)[0] if errors[:, a].any()}
        moved = self.rows.moved(np.where(by_force, 0.0, errors))
        return replace(moved, columns={**moved.columns, **pushed}) if pushed else moved

    def part(self, rows: slice | NDArray[np.intp]) -> Problem:
        """Some rows as they are: what was measured once is in one of the parts only."""
        some = self.rows.take(rows)
        return replace(
            self,
            rows=some,
            poses=self._nominal.part(rows, some),
            readings=self.readings[rows],
            sigma=some_rows(self.sigma, rows),
            drive_sigma=some_rows(self.drive_sigma, rows),
            side_sigma=None if self.side_sigma is None else some_rows(self.side_sigma, rows),
            measured=self.measured[rows],
            weight=None if self.weight is None else self.weight[rows],
            copies=(),
        )


def usable(problem: Problem) -> Problem:
    """The problem with what was measured once in its first row, and without distances to rows that it has not.

    The first row in which something else was measured: one that is left out may have no prediction.
    """
    measured, readings = problem.measured.copy(), problem.readings
    once = problem.once
    if once and len(problem):
        readings = readings.copy()
        readings[:, once], measured[:, once] = np.nan, False
        first = int(np.argmax(measured.any(axis=1)))
        readings[first, once] = [problem.model.channels[k].once for k in once]
        measured[first, once] = True
    if len(problem.joining):
        alone = np.ones(len(problem), dtype=bool) if problem.rows.partner is None else problem.rows.partner < 0
        measured[np.ix_(alone, problem.joining)] = False
    return replace(problem, readings=readings, measured=measured)


def stated_sigma(model: Model, readings: Array) -> Array:
    """Standard uncertainties (N, C) of readings (N, C) by the machine file: nan where it states none.

    (sigma + sigma_slope * distance)^2 + (sigma_per_length * distance)^2; the distance is that from the instrument's
    origin, or the length read.
    """
    out = np.tile([c.sigma for c in model.channels], (len(readings), 1)).reshape(readings.shape)
    for sensor in model.sensors:
        coordinates = [k for k in sensor.channels if model.channels[k].measurand is not Measurand.ORIENTATION]
        slope, growth = np.array([_growth(model.channels[k]) for k in coordinates]).reshape(-1, 2).T
        if slope.any() or growth.any():
            far = np.sqrt(np.nansum(readings[:, coordinates] ** 2, axis=1, keepdims=True))
            out[:, coordinates] = np.hypot(out[:, coordinates] + slope * far, growth * far)
    return out


def _growth(channel: Channel) -> tuple[float, float]:
    """Growth of sigma with distance, as a linear sum and in quadrature."""
    return channel.sigma_slope, channel.sigma_per_length


def design_problem(model: Model, rows: Rows, measured: NDArray[np.bool_] | None = None) -> Problem:
    """A plan without data: every channel with a sigma will be measured in every row, or those of `measured` (N, C)."""
    shape = (len(rows), len(model.channels))
    grows = any(any(_growth(c)) for c in model.channels)
    far = predict(model, model.nominal, rows).values if grows else None
    sigma = stated_sigma(model, np.full(shape, np.nan) if far is None else far)
    drives = np.tile(drive_sigma(model), (len(rows), 1))
    on = ~np.isnan(sigma) if measured is None else measured & ~np.isnan(sigma)
    return usable(
        Problem(model=model, rows=rows, readings=np.full(shape, np.nan), sigma=sigma, drive_sigma=drives, measured=on)
    )
