"""Covariates of a table as effects want them: columns, sessions, and the direction of the last motion of each drive."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from pkmcal_cli.base.errors import BadInput, Fault, Location
from pkmcal_cli.base.lean import lean
from pkmcal_cli.base.plural import count, listed
from pkmcal_cli.base.rotation import Array
from pkmcal_cli.model.commanded import forced, reading_drives
from pkmcal_cli.model.effect_sites import PlacedEffect
from pkmcal_cli.model.model import Model
from pkmcal_cli.prediction import Request, Rows, predict
from pkmcal_cli.tables.measurement_set import Measurements

_REST = {
    "temperature": ("T", 293.15, "20 degC"),
    "time": ("time", 0.0, "time 0"),
    "payload": ("payload", 0.0, "no payload"),
    "spindle": ("spindle", 0.0, "spindle at 0 deg"),
}
"""Column, value (SI) and words of what effects need, where nobody measured."""
_STILL = 1e-9  # m or rad; a drive that moves less has not moved


def with_covariates(rows: Rows, measurements: Measurements) -> Rows:
    """Rows with the covariates of their measurements, and which session each belongs to."""
    columns = {name: np.asarray(column) for name, column in measurements.covariates.items()}
    for k, name in enumerate(measurements.sessions):
        columns[f"session.{name}"] = lean(np.asarray(measurements.session == k, dtype=float))
    return replace(rows, columns=columns, unnamed=not measurements.named_sessions)


def require_filled(model: Model, measurements: Measurements) -> None:
    """Raises BadInput for columns of circumstances that declared effects need and some rows lack, where these stand."""
    gaps: dict[str, list[str]] = {}
    for effect in (e for e in model.effects if e.sites):
        for column in _columns_of(effect, measurements.covariates):
            if np.isnan(measurements.covariates[column]).any():
                gaps.setdefault(column, []).append(effect.name)
    faults = []
    for column, effects in gaps.items():
        empty = np.nonzero(np.isnan(measurements.covariates[column]))[0]
        where = Location(measurements.files[measurements.file_index[empty[0]]], int(measurements.line[empty[0]]))
        rows = f"{len(empty)} of {count(len(measurements), 'row')}"
        message = f"`{column}` is empty in {rows}, of which this is the first; needed by {listed(effects, 3)}"
        hint = "fill it, or leave these rows out, or delete the effect from the machine file"
        faults.append(Fault("csv-empty-cell", message, where, hint))
    if faults:
        raise BadInput(faults)


def _columns_of(effect: PlacedEffect, columns: Collection[str]) -> list[str]:
    """Columns of a table that an effect uses: of a temperature that of the part, where there is one."""
    names = [_REST[need][0] for need in effect.effect.needs if need in _REST]
    names += ["time"] if any(p.name == "lag" for p in effect.effect.parameters) else []
    parts = {site.part for site in effect.sites}
    ways = [(f"T.{part}", "T") if name == "T" else (name,) for name in names for part in parts]
    return sorted({there for way in ways if (there := next((n for n in way if n in columns), ""))})


def with_directions(rows: Rows, names: Sequence[str]) -> Rows:
    """Rows with `dir.ACTUATOR` for every drive; a given direction stays, an empty or missing one is derived.

    From the order in which rows were measured: of each session by time where it is known, else as they stand.
    """
    columns = dict(rows.columns)
    order = _measured_order(rows)
    derived = np.empty(rows.readings.shape)
    derived[order] = directions(rows.readings[order], rows.session[order])
    for a, name in enumerate(names):
        measured = columns.get(f"dir.{name}", np.full(len(rows), np.nan))
        columns[f"dir.{name}"] = np.where(np.isnan(measured), derived[:, a], measured).astype(np.int8)  # lean
    return replace(rows, columns=columns)


def with_sides(rows: Rows, model: Model) -> Rows:
    """The same; drives that hold no position come from where the nominal machine takes them, where a row does not say.
    """
    there = replace(rows, readings=_followed(model, rows))
    return replace(with_directions(there, model.drive_names), readings=rows.readings)


def _followed(model: Model, rows: Rows) -> Array:
    """Readings (N, A), predicted ones of force-controlled drives that lack some of them, and have no stated side."""
    stated = [not np.isnan(rows.columns.get(f"dir.{name}", np.nan)).any() for name in model.drive_names]
    drives = np.nonzero(forced(model) & ~np.array(stated, dtype=bool) & np.isnan(rows.readings).any(axis=0))[0]
    if not len(drives) or not len(rows):
        return rows.readings
    bare = reading_drives(model, drives)
    predicted, out = predict(bare, bare.nominal, rows, Request(compare=False)).values, rows.readings.copy()
    out[:, drives] = predicted  # in all rows: their encoders may have another zero
    return out


def _measured_order(rows: Rows) -> NDArray[np.intp]:
    """Rows (N,) as they were measured, by session; of one time as they stand."""
    time = rows.columns.get("time")
    if time is None or not np.isfinite(time).all() or not len(rows):
        return np.arange(len(rows))
    return np.lexsort((time, rows.session))


def at_rest(model: Model, rows: Rows) -> Rows:
    """Rows of positions that nobody measured: columns that declared effects need, where these do nothing or little.

    20 degC, no payload, spindle and time at 0; directions of approach by the order of the rows. Parts that lag behind
    their temperatures have settled.
    """
    columns = {name: np.full(len(rows), value) for name, value, _ in _resting(model).values()}
    if lagging(model):
        columns["time"] = np.zeros(len(rows))
    named = with_sides(rows, model)
    return replace(rows, columns={**named.columns, **columns})


def lagging(model: Model) -> bool:
    """Whether a part lags behind its temperature, which takes the time of each row."""
    return any(p.name == "lag" for e in model.effects if e.sites for p in e.effect.parameters)


def reference_conditions(model: Model, names: Collection[str]) -> tuple[dict[str, float], str]:
    """Columns, SI, that declared effects need besides those that are given, and what is to be said of them."""
    bare = {name.partition(".")[0] for name in names}
    at_reference = {need: r for need, r in _resting(model).items() if r[0] not in bare}
    return {name: value for name, value, _ in at_reference.values()}, _words(at_reference)


def without_effect(model: Model, columns: Collection[str]) -> list[str]:
    """Which of some columns no declared effect depends on."""
    needs = {need for e in model.effects if e.sites for need in e.effect.needs}
    needed = {"direction": "dir", **{need: column for need, (column, _, _) in _REST.items()}}
    acting = {needed[need] for need in needs if need in needed} | ({"time"} if lagging(model) else set())
    return [name for name in columns if name.partition(".")[0] not in acting]


def resting(model: Model) -> str:
    """What is to be said of effects at rest; "" without any."""
    return _words(_resting(model))


def _words(values: Mapping[str, tuple[str, float, str]]) -> str:
    texts = ", ".join(words for _, _, words in values.values())
    if not values:
        return ""
    return f"effects that depend on {', '.join(values)} are evaluated at reference conditions: {texts}"


def _resting(model: Model) -> dict[str, tuple[str, float, str]]:
    needs = {need for e in model.effects if e.sites for need in e.effect.needs}
    return {need: resting for need, resting in _REST.items() if need in needs}


def directions(readings: Array, session: NDArray[np.int64]) -> Array:
    """Directions (N, A) of the last motion, -1 or 1, of rows as they were measured; 0 before the first of a session.

    A drive that stands still keeps its direction.
    """
    step = np.diff(readings, axis=0, prepend=readings[:1])
    sign = np.where(np.abs(step) > _STILL, np.sign(step), 0.0)
    first = np.diff(session, prepend=session[:1] - 1) != 0
    sign[first] = 0.0
    rows = np.arange(len(readings))[:, None]
    known = np.where((sign != 0) | first[:, None], rows, 0)
    last = np.maximum.accumulate(known, axis=0)
    return np.take_along_axis(sign, last, axis=0)


def derived_directions(measurements: Measurements, names: Sequence[str]) -> tuple[str, ...]:
    """Drives whose direction the table does not give."""
    columns = measurements.covariates
    return tuple(n for n in names if f"dir.{n}" not in columns or bool(np.isnan(columns[f"dir.{n}"]).any()))
