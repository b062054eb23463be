"""Tables and parameters from Python as inputs, results as pandas tables: columns are named as in files, `x [mm]`."""

from __future__ import annotations

import json
import os
from collections.abc import Mapping, Sequence
from numbers import Real
from typing import TYPE_CHECKING, Any, Protocol

import numpy as np
import pandas as pd

from pkmcal_cli.base.errors import UsageError
from pkmcal_cli.base.files import AtHand, is_stream
from pkmcal_cli.csv_files.dialect import split_header
from pkmcal_cli.csv_files.writer import Values
from pkmcal_cli.language.machine import Machine
from pkmcal_cli.tables.columns import Column, columns_of, temperature_column
from pkmcal_cli.tables.measurement_set import Measurements
from pkmcal_cli.units.unit_text import parse_unit

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

    WithUnit = ArrayLike | tuple[ArrayLike, str]

Table = str | os.PathLike[str] | pd.DataFrame | Mapping[str, "WithUnit"]
"""A table: the path of a CSV file; a DataFrame; or arrays by name, with their unit: `{"q1": ([1.0, 2.0], "mm")}`."""

_HOW = 'give a path, a DataFrame, or arrays by name such as {"q1": (array, "mm")}'


class HasParameters(Protocol):
    """A result that has identified parameters."""

    def parameter_text(self) -> str:
        """Text of its parameter file."""


Parameters = str | os.PathLike[str] | Mapping[str, float | str] | HasParameters
"""Parameter values: a file; a calibration; or by name, `{"l1": "300.02 mm"}` (numbers: in the parameter's unit)."""


def file_of(path: str | os.PathLike[str]) -> str:
    """The name of a file. Raises UsageError for stdin, which a program has not."""
    if not isinstance(path, str | os.PathLike):
        raise UsageError(f"no file: {type(path).__name__}", hint="give the path of a file")
    name = os.fspath(path)
    if is_stream(name):
        raise UsageError("`-` is stdin, which only the command line reads", hint="give the path of a file")
    return name


def source_of(table: Table, name: str = "table") -> str:
    """A table as an input; `name`: what messages call it. Raises UsageError for what is no table."""
    if isinstance(table, str | os.PathLike):
        return file_of(table)
    frame = table if isinstance(table, pd.DataFrame) else _frame(table, name)
    if frame.columns.nlevels > 1:
        raise UsageError(f"{name}: column names have several levels", hint='name columns as in files: "x [mm]"')
    if frame.index.name is not None and frame.index.name not in frame.columns:
        frame = frame.reset_index()
    frame = frame.assign(**{c: frame[c].map(_one_line) for c in frame.columns[_texts(frame)]})
    return AtHand.of(name, frame.to_csv(index=False, lineterminator="\n"))


def _texts(frame: pd.DataFrame) -> list[bool]:
    """Which columns may have texts, and have a name of their own."""
    alone = ~frame.columns.duplicated(keep=False)
    texts = ("object", "str", "string")
    return [bool(one) and str(kind) in texts for one, kind in zip(alone, frame.dtypes, strict=True)]


def _one_line(value: Any) -> Any:
    """A text without line breaks, which no cell of a table has."""
    return " ".join(value.splitlines()) if isinstance(value, str) else value


def sources_of(tables: Table | Sequence[Table]) -> tuple[str, ...]:
    """One table, or several, each of which is a session. Raises UsageError."""
    if isinstance(tables, str | os.PathLike | pd.DataFrame | Mapping):
        return (source_of(tables),)
    if not isinstance(tables, Sequence) or not tables:
        raise UsageError(f"no table: {type(tables).__name__}", hint=_HOW)
    return tuple(source_of(table, f"table{k}") for k, table in enumerate(tables, start=1))


def parameters_of(parameters: Parameters | None) -> str | None:
    """Parameter values as an input. Raises UsageError for what has none."""
    if parameters is None:
        return None
    if isinstance(parameters, str | os.PathLike):
        return file_of(parameters)
    if isinstance(parameters, Mapping):
        if wrong := [k for k, v in parameters.items() if not isinstance(v, str | Real)]:
            message = f"parameter `{wrong[0]}`: no value: {parameters[wrong[0]]!r}"
            raise UsageError(message, hint='give 300.02, or "300.02 mm"')
        values = {str(k): v if isinstance(v, str) else float(v) for k, v in parameters.items()}
        return AtHand.of("parameters.yaml", json.dumps({"parameters": values}, ensure_ascii=False))
    if not hasattr(parameters, "parameter_text"):
        hint = 'give a file, a calibration, or values by name such as {"l1": "300.02 mm"}'
        raise UsageError(f"no parameters: {type(parameters).__name__}", hint=hint)
    return AtHand.of("calibration.params.yaml", parameters.parameter_text())


def _frame(arrays: Mapping[str, WithUnit], name: str) -> pd.DataFrame:
    """Arrays by name as a table. Raises UsageError."""
    if not isinstance(arrays, Mapping):
        raise UsageError(f"{name}: no table: {type(arrays).__name__}", hint=_HOW)
    columns: dict[str, Any] = {}
    for label, label_values in arrays.items():
        values, unit = _with_unit(label_values)
        array = np.asarray(values)
        if array.ndim != 1:
            raise UsageError(f"{name}: column `{label}` is no list of values, but of shape {array.shape}", hint=_HOW)
        columns[f"{label} [{unit}]" if unit else label] = array
    if len({len(c) for c in columns.values()}) > 1:
        lengths = ", ".join(f"`{n}` {len(c)}" for n, c in columns.items())
        raise UsageError(f"{name}: columns differ in length: {lengths}", hint="give one value per row in every column")
    return pd.DataFrame(columns)


def _with_unit(value: Any) -> tuple[Any, str]:
    """Values and their unit, "" for none."""
    if isinstance(value, tuple) and len(value) == 2 and isinstance(value[1], str) and not isinstance(value[0], str):
        return value[0], value[1]
    return value, ""


def frame_of(columns: Sequence[tuple[str, str | None]], cells: Sequence[Values]) -> pd.DataFrame:
    """Columns (name, unit) and their values, SI or texts, as a table in these units."""
    out: dict[str, Any] = {}
    for (name, text), values in zip(columns, cells, strict=True):
        unit = None if text is None else parse_unit(text)
        label = name if unit is None or not unit.text else f"{name} [{unit.text}]"
        out[label] = values if unit is None else np.asarray(unit.from_si(np.asarray(values, dtype=float)))  # type: ignore[arg-type]
    return pd.DataFrame(out)


def measured_frame(machine: Machine, measured: Measurements) -> pd.DataFrame:
    """A table that was read: one row for each of its rows, in the units of the machine file."""
    columns: list[tuple[str, str | None]] = []
    cells: list[Values] = []
    arrays = _arrays(measured)
    for label, texts in measured.labels.items():
        columns.append((label, None))
        cells.append(list(texts))
    if len(measured.sessions) > 1 and "session" not in measured.labels:
        columns.append(("session", None))
        cells.append([measured.sessions[k] for k in measured.session])
    known: dict[tuple[str, str], Column] = {(c.name, c.role): c for c in columns_of(machine)}
    for (name, role), values in arrays.items():
        column = known.get((name, role)) or temperature_column(name, machine)
        if column is None or np.isnan(values).all():
            continue
        header = split_header(column.header)
        columns.append((header.name if header.unit else column.header, column.unit))
        cells.append(values / column.scale)
    return frame_of(columns, cells)


def _arrays(measured: Measurements) -> dict[tuple[str, str], Any]:
    """Numbers (N,) by name and role, SI."""
    out: dict[tuple[str, str], Any] = {(n, "covariate"): v for n, v in measured.covariates.items()}
    names = measured.actuator_names
    held = set(measured.channels)  # a force-controlled drive's reading is a channel
    out |= {(n, "actuator"): measured.actuators[:, k] for k, n in enumerate(names) if n not in held}
    out |= {(n, "channel"): measured.readings[:, k] for k, n in enumerate(measured.channels)}
    out |= {(f"{n}.force", "force"): measured.forces[:, k] for k, n in enumerate(names)}
    out |= {(f"sigma.{n}", "sigma"): measured.sigma[:, k] for k, n in enumerate(measured.channels)}
    return out
