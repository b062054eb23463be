"""What an improved machine file says besides estimates: constants of effects, and the range of the table."""

from __future__ import annotations

import json
import re

import numpy as np

from pkmcal_cli.diagnosis.hypotheses import Hypothesis
from pkmcal_cli.model.model import Model
from pkmcal_cli.prediction import Rows
from pkmcal_cli.units.unit_text import parse_unit

_PLAIN = re.compile(r"[A-Za-z0-9_@.+\-\[\]]+")


def effect_key(hypothesis: Hypothesis) -> str:
    """The name of an effect as a key of YAML: quoted where a session is called oddly."""
    return hypothesis.name if _PLAIN.fullmatch(hypothesis.name) else json.dumps(hypothesis.name, ensure_ascii=False)


def null_lines(model: Model, hypothesis: Hypothesis) -> list[str]:
    """The numbers of an effect without which it explains the data as well."""
    placed = next(e for e in model.effects if e.name == hypothesis.name)
    needless = [n.rpartition(".")[2] for n in placed.parameters if n not in hypothesis.parameters]
    return [f"    {name}: {{identify: false}}  # not needed" for name in needless]


def option_lines(model: Model, rows: Rows, hypothesis: Hypothesis) -> list[str]:
    """Constants of an effect that the table decided, so that other tables see the same effect."""
    from pkmcal_cli.prediction import fixed_options

    placed = next(e for e in model.effects if e.name == hypothesis.name)
    out = []
    for name, (values, unit) in fixed_options(model, placed, rows).items():
        shown = ", ".join(f"{parse_unit(unit).from_si(v):.8g} {unit}" for v in values)
        out.append(f"    {name}: " + (f"[{shown}]" if len(values) > 1 else shown))
    return out


def validity(model: Model, rows: Rows) -> str:
    """Range of the table: travel of the drives, temperatures that were logged."""
    out = []
    for a, actuator in enumerate(model.actuators):
        unit, travel = parse_unit(actuator.unit), rows.readings[:, a]
        if np.isfinite(travel).all():
            low, high = unit.from_si(float(travel.min())), unit.from_si(float(travel.max()))
            out.append(f"{actuator.name} {low:.6g} to {high:.6g} {unit.text}")
    for name, column in rows.columns.items():
        if (name == "T" or name.startswith("T.")) and np.isfinite(column).all():
            out.append(f"{name} {column.min() - 273.15:.1f} to {column.max() - 273.15:.1f} degC")
    return f"; valid for {', '.join(out)}" if out else ""
