"""The results of `sensitivity` and `observability`: tables and JSON."""

from __future__ import annotations

from typing import Any

from pkmcal_cli.base.plural import count
from pkmcal_cli.calibration.identifiability import Combination
from pkmcal_cli.calibration.observability import Observability
from pkmcal_cli.calibration.sensitivity import Sensitivity
from pkmcal_cli.model.model import Model
from pkmcal_cli.report.console import Reporter, bar
from pkmcal_cli.report.numbers import finite, readable, short
from pkmcal_cli.report.parameters import combination_json, parameter_unit
from pkmcal_cli.units.file_units import FileUnits

_WIDER = 1.5  # times the stated uncertainty: what data alone would tell is worth a word

UNSTRAINED = (
    "parameters are at nominal: a machine without errors is hardly strained, so what acts by force looks "
    "invisible; -p PARAMS.yaml takes identified parameters"
)


def show_sensitivity(to: Reporter, model: Model, units: FileUnits, found: Sensitivity, rows: int) -> None:
    """Ranked table with bars."""
    largest = max((p.position for p in found.parameters), default=0.0) or 1.0
    table = []
    for p in found.parameters:
        unit = parameter_unit(model, p.name)
        shift, turn = readable(p.position, units.length), readable(p.orientation, units.angle)
        table.append((p.name, f"+-{p.range / unit.scale:.4g} {unit.text}", shift, bar(p.position / largest), turn))
    title = f"Mean shift and turn of the TCP for one range of each parameter, {count(rows, 'position')} (eq. 23)"
    to.table(title, ("parameter", "range", "shift", "", "turn"), table)


def sensitivity_json(model: Model, units: FileUnits, found: Sensitivity, rows: int) -> dict[str, Any]:
    """Ranked as in the table; orientation in rad."""
    listed = []
    for p in found.parameters:
        unit = parameter_unit(model, p.name)
        listed.append(
            {
                "name": p.name,
                "position": finite(p.position / units.length.scale),
                "orientation": finite(p.orientation),
                "unit": units.length.text,
                "orientation_unit": "rad",
                "range": p.range / unit.scale,
                "range_unit": unit.text,
            }
        )
    return {"n_rows": rows, "parameters": listed}


def show_observability(to: Reporter, model: Model, found: Observability, rows: int) -> None:
    """Expected uncertainties, figures of merit, and what is not told apart."""
    directions, selected = found.found, found.selected
    table = []
    for name, std, alone, gone in zip(selected, found.std, found.alone, directions.undetermined(), strict=True):
        p, unit = model.parameters[model.names.index(name)], parameter_unit(model, name)
        shown = "undetermined" if gone else f"{std / unit.scale:.3g} {unit.text}"
        share = "" if gone else f"{std / p.range:.3f}"
        remark = "" if gone or std < p.range / 2 else "no better than its range tells already"
        if not gone and alone > _WIDER * std:
            remark = f"weak: {alone / unit.scale:.3g} {unit.text} by these data alone; held, the range tells more"
        table.append((name, f"+-{p.range / unit.scale:.4g} {unit.text}", shown, share, remark))
    title = f"Expected standard uncertainty from {count(found.count, 'measured value')} in {count(rows, 'position')}"
    to.table(title, ("parameter", "range", "standard uncertainty", "std/range", "remark"), table)
    to.say()
    if found.datum is not None:
        to.say(found.datum.text)
        if found.datum.missing:
            to.say(f"state what defines the base: `datum: [{', '.join(found.datum.proposed)}]`")
    to.say(f"rank {directions.rank} of {len(selected)}")
    paper, whitened = short(found.condition_number), short(directions.condition_number)
    to.say(f"condition number {paper} (Js of the paper), {whitened} (whitened)")
    to.say(", ".join(f"{k} {short(v)}" for k, v in found.indices.items()))
    to.say("singular values (whitened): " + " ".join(short(float(v)) for v in directions.singular_values))
    for c in found.undetermined:
        *others, last = c.told
        head = "not determined" if c.kind == "null" else "weak"
        for text in others:
            to.say(f"{head}: {text}")
        to.say(f"{head}: {last}; {_advice(c)}")


def _advice(c: Combination) -> str:
    """Which parameters to drop, or what to measure otherwise."""
    select = f"`--select auto,{','.join(f'-{n}' for n in c.hold)}`"
    if len(c.names) == 1:
        return f"leave it out ({select}) or measure where it acts"
    if len(c.hold) == 1:
        return f"hold one of them ({select}), measure it directly, or spread the positions"
    return f"hold {len(c.hold)} of them ({select}), measure these directly, or spread the positions"


def observability_json(model: Model, found: Observability, rows: int) -> dict[str, Any]:
    """Figures of merit; uncertainties in each parameter's unit, null where undetermined."""
    parameters = []
    for name, std, alone in zip(found.selected, found.std, found.alone, strict=True):
        unit = parameter_unit(model, name)
        values = {"std": finite(std / unit.scale), "std_of_data": finite(alone / unit.scale)}
        parameters.append({"name": name, **values, "unit": unit.text})
    return {
        "n_rows": rows,
        "n_values": found.count,
        "condition_number": finite(found.condition_number),
        "condition_number_whitened": finite(found.found.condition_number),
        "rank": found.found.rank,
        "singular_values": [float(v) for v in found.found.singular_values],
        **{name: finite(value) for name, value in found.indices.items()},
        "parameters": parameters,
        "datum": None if found.datum is None else list(found.datum.held),
        "gauge": [] if found.datum is None else list(found.datum.gauge.motions),
        "undetermined": [each for c in found.undetermined for each in combination_json(model, c)],
    }
