"""Formulas of effects ask for quantities of the whole table at one effect site: here they are computed.

A lagged quantity x solves tau dx/dt = u - x, exactly for u linear between its times (the first-order hold of sampled
systems), and starts in steady state.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np

from pkmcal_cli.base.errors import BadInput, Location
from pkmcal_cli.base.rotation import Array
from pkmcal_cli.model.effect_sites import AtSite, PlacedEffect
from pkmcal_cli.model.model import Model
from pkmcal_cli.prediction.rows import Rows
from pkmcal_cli.units.unit_text import UNITS

_REFERENCE = UNITS["degC"].to_si(20.0)  # K, ISO 1
_DEFAULTS = {"smooth": 10.0}  # N


@dataclass(frozen=True)
class Reactions:
    """Of the pass before: forces (N, R) at places, chords (N, 3) of members by (group, element).

    jacobian (N, R, P') and by_drive (N, R, A): derivatives by asked parameters and by drive readings, or None.
    """

    places: tuple[tuple[int, int, int], ...]
    values: Array
    chords: Mapping[tuple[int, int], Array]
    jacobian: Array | None
    by_drive: Array | None


@dataclass(frozen=True)
class SiteInputs(AtSite):
    """Inputs of one effect at one effect site; see `effects.effect.Inputs`."""

    model: Model
    table: Rows
    placed: PlacedEffect
    reactions: Reactions | None
    step: complex = 0.0  # on the drive's reading, for its derivative
    pull_step: complex = 0.0  # on the force of the earlier pass

    @property
    def rows(self) -> int:
        """Number of rows."""
        return len(self.table)

    @property
    def drive(self) -> int:
        """The drive whose reading the formula may ask for: that of the place, or of the leg."""
        return self.site.actuator if self.site.leg < 0 else self.site.leg

    @property
    def length(self) -> Array | float:
        """Of the member, m: (N,) of a leg as its drive sets it, by its nominal law; else nominal."""
        if self.site.leg < 0:
            return self.site.length
        extended = self.reading - float(self.model.reference_readings[self.site.leg])
        return np.asarray(self.site.length + self._gain(self.site.leg) * extended)

    @property
    def reading(self) -> Array:
        """Reading of the drive; 0 where nobody read it: then nothing is compared with it either."""
        read = self.table.readings[:, self.drive]
        read = np.where(np.isnan(read), 0.0, read)
        return np.asarray(read + self.step if self.step else read)

    @property
    def travel(self) -> Array:
        """Travel of the drive from its reading zero, by its nominal law."""
        return np.asarray(self._gain(self.site.actuator) * self.reading)

    def _gain(self, actuator: int) -> float:
        return float(self.model.topology.coefficients.constants[self.model.actuators[actuator].gain_coefficient])

    @cached_property
    def normalised_travel(self) -> Array:
        """Place in the travel, -1 at its start, 1 at its end."""
        low, high = self.over
        return 2 * (self.travel - low) / (high - low) - 1

    @property
    def centred_travel(self) -> Array:
        """Travel of the drive from the middle of the travel, m or rad."""
        low, high = self.over
        return self.travel - 0.5 * (low + high)

    @property
    def over(self) -> tuple[float, float]:
        """Travel on which shapes are spread: as declared, the limits, or that of the table, m or rad."""
        over = self.placed.options.get("over")
        if over is not None:
            return over[0], over[1]
        drives = sorted({s.actuator for s in self.placed.sites if s.part == self.site.part})
        ends: list[float] = []
        for a in drives:
            gain = self._gain(a)
            limits = [gain * limit for limit in self.model.actuators[a].limits]
            known = self.table.readings[:, a][~np.isnan(self.table.readings[:, a])]
            ends += limits if np.isfinite(limits).all() else (gain * known).tolist()
        low, high = min(ends, default=0.0), max(ends, default=0.0)
        return (low, high) if high > low else (low - 0.5, low + 0.5)

    @property
    def direction(self) -> Array:
        """Direction of the last motion of the drive."""
        return self._column(f"dir.{self.model.actuators[self.site.actuator].name}")

    @property
    def motion(self) -> Array:
        """Direction of the last motion of the drive along its travel, against which readings may count."""
        return np.asarray(np.sign(self._gain(self.site.actuator)) * self.direction)

    @property
    def temperature_rise(self) -> Array:
        """Temperature above the reference, of the part's own column where there is one, K."""
        return self._column(f"T.{self.site.part}", "T") - self.placed.options.get("reference", (_REFERENCE,))[0]

    def lagged(self, tau: Any) -> Array:
        """Temperature rise w behind a first-order lag: tau w' = T - w, w = T in the first row, T linear between."""
        if np.real(tau) == 0 and "time" not in self.table.columns:
            return self.temperature_rise  # a lag cannot be seen then
        return lag(self._column("time"), self.temperature_rise, tau)

    @property
    def time(self) -> Array:
        """Time, s."""
        return self._column("time")

    @cached_property
    def normalised_time(self) -> Array:
        """Place in time, -1 at the start, 1 at the end."""
        first, last = self.during
        return 2 * (self.time - first) / (last - first) - 1

    @property
    def during(self) -> tuple[float, float]:
        """Time on which shapes are spread: as declared, or that of the table, s."""
        during = self.placed.options.get("during")
        if during is not None:
            return during[0], during[1]
        first, last = float(self.time.min()), float(self.time.max())
        return (first, last) if last > first else (first - 0.5, first + 0.5)

    @property
    def payload(self) -> Array:
        """Payload, kg."""
        return self._column("payload")

    @property
    def spindle(self) -> Array:
        """Angle of the spindle, rad."""
        return self._column("spindle")

    @property
    def commanded_force(self) -> Array:
        """Commanded force of a force-controlled drive: of the table, else as the machine file states it."""
        stated = self.table.forces[:, self.site.actuator]
        at = self.model.actuators[self.site.actuator].force_coefficient
        return np.where(np.isnan(stated), self.model.topology.coefficients.constants[at], stated)

    @property
    def pull(self) -> Array:
        """Force of the earlier pass in the member, or of the drive, N."""
        assert self.reactions is not None
        value = self.reactions.values[:, self.reactions.places.index(self.site.place)]
        return np.asarray(self.site.weight * (value + self.pull_step if self.pull_step else value))

    @property
    def chord(self) -> Array:
        """Unit vectors (N, 3) along the member in the earlier pass."""
        assert self.reactions is not None
        return self.reactions.chords[self.site.member]

    def option(self, name: str) -> float:
        """A constant of the effect."""
        stated = self.placed.options.get(name)
        if stated is not None:
            return stated[0]
        value = self.site.period if name == "period" else _DEFAULTS[name]
        if np.isnan(value):
            hint = f"give `{name}` here, or `period` of actuator `{self.site.part}`"
            raise BadInput.single(
                f"effect `{self.placed.name}` needs `{name}`", Location(self.model.name), hint, "effect"
            )
        return value

    def _column(self, *names: str) -> Array:
        column = next((self.table.columns[name] for name in names if name in self.table.columns), None)
        if column is None or np.isnan(column).any():
            message = f"effect `{self.placed.name}` needs the column {' or '.join(f'`{n}`' for n in names)}"
            message += "" if column is None else " in every row, and cells of it are empty"
            way = "log it with the measurement" if column is None else "fill in the empty cells"
            hint = f"{way}, or delete the effect from the machine file"
            raise BadInput.single(message, Location(self.model.name), hint, "csv-missing")
        return np.asarray(column)


def bounds_of(model: Model, columns: Collection[str]) -> Array:
    """Bounds (P, 2) of the parameters, SI; a lag that nobody can see, as there are no times, stays at 0."""
    out = np.array([p.bounds for p in model.parameters]).reshape(-1, 2)
    if "time" not in columns:
        lags = {n for e in model.effects for n, number in zip(e.parameters, e.numbers, strict=True) if number == "lag"}
        out[[k for k, name in enumerate(model.names) if name in lags]] = 0.0
    return out


def lag(time: Array, value: Array, tau: Any) -> Array:
    """Apply a first-order lag (N,) to a value that is linear between its times, in steady state at the first row.

    By a scan over pairs (decay, lagged), doubling the distance: exact, without a loop over rows. Analytic in tau.
    """
    if tau == 0:
        return value
    order = np.argsort(time, kind="stable")
    step = np.diff(time[order], prepend=time[order[:1]])
    current, before = value[order], np.concatenate([value[order[:1]], value[order[:-1]]])
    if np.real(tau) == 0:  # at once, and what a small lag would change
        slope = np.divide(current - before, step, out=np.zeros_like(current), where=step > 0)
        return np.asarray((current - tau * slope)[np.argsort(order)])
    ratio = step / tau
    decay = np.exp(-ratio)
    safe = np.where(step == 0, 1.0, ratio)
    weight = np.where(step == 0, 0.0, (1 - decay) / safe)  # mean of the kernel over the step
    lagged = current * (1 - weight) + before * (weight - decay)
    lagged[0], decay[0] = current[0], 0.0
    distance = 1
    while distance < len(time):
        lagged[distance:] = lagged[distance:] + decay[distance:] * lagged[:-distance]
        decay[distance:] = decay[distance:] * decay[:-distance]
        distance *= 2
    out = np.empty_like(lagged)
    out[order] = lagged
    return np.asarray(out)


def fixed_options(model: Model, placed: PlacedEffect, rows: Rows) -> dict[str, tuple[tuple[float, ...], str]]:
    """Give the constants of an effect as the table fixes them, SI, with the unit in which they are written."""
    out: dict[str, tuple[tuple[float, ...], str]] = {}
    inputs = SiteInputs(placed.sites[0], model, rows, placed, None)
    for option in placed.effect.options:
        unit = option.rotary if option.rotary is not None and placed.sites[0].kind == "rotary" else option.unit
        stated = placed.options.get(option.name)
        if stated is not None:
            out[option.name] = (stated, unit)
        elif option.name == "over":
            out[option.name] = (inputs.over, unit)
        elif option.name == "during":
            out[option.name] = (inputs.during, unit)
        elif option.name == "reference":
            out[option.name] = ((_REFERENCE,), unit)
        else:
            out[option.name] = ((inputs.option(option.name),), unit)
    return out


def frozen(model: Model, rows: Rows) -> Model:
    """Make the model whose effects spread their shapes over travel and time of these rows, whatever rows are predicted.

    Effects whose places have different travels keep to the rows that are predicted.
    """
    return model.with_options(tuple(_frozen(model, rows, e) for e in model.effects))


def _frozen(model: Model, rows: Rows, placed: PlacedEffect) -> PlacedEffect:
    options = dict(placed.options)
    for option in placed.effect.options:
        if option.name in ("over", "during") and option.name not in options:
            spans = {getattr(SiteInputs(s, model, rows, placed, None), option.name) for s in placed.sites}
            if len(spans) == 1:
                options[option.name] = next(iter(spans))
    return replace(placed, options=options)
