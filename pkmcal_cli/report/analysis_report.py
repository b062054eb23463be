"""The results of `sensitivity` and `observability`: tables and JSON."""

from __future__ import annotations

from typing import Any

from pkmcal_cli.base.plural import count
from pkmcal_cli.calibration.identifiability import Combination
from pkmcal_cli.calibration.mean_sensitivity import Sensitivity
from pkmcal_cli.calibration.observability_indices import Observability
from pkmcal_cli.model.model import Model
from pkmcal_cli.report.console import Reporter, bar
from pkmcal_cli.report.number_format import finite, readable, short
from pkmcal_cli.report.parameters import combination_json, hold_text, parameter_unit, without
from pkmcal_cli.units.file_units import FileUnits

_WIDER = 1.5  # times the stated uncertainty: what data alone would tell is worth a word

UNSTRAINED = (
    "note: all parameters are at nominal, so the machine is hardly strained and effects that act through forces "
    "look invisible; use identified parameters: `-p PARAMS.yaml`"
)


def show_sensitivity(to: Reporter, model: Model, units: FileUnits, sensitivity: Sensitivity, rows: int) -> None:
    """Ranked table with bars."""
    largest = max((p.position for p in sensitivity.parameters), default=0.0) or 1.0
    table = []
    for p in sensitivity.parameters:
        unit = parameter_unit(model, p.name)
        shift, turn = readable(p.position, units.length), readable(p.orientation, units.angle)
        table.append((p.name, f"+-{p.range / unit.scale:.4g} {unit.text}", shift, bar(p.position / largest), turn))
    title = f"Mean TCP shift and rotation per parameter range, {count(rows, 'position')} (eq. 23)"
    to.table(title, ("parameter", "range", "shift", "", "rotation"), table)


def sensitivity_json(model: Model, units: FileUnits, sensitivity: Sensitivity, rows: int) -> dict[str, Any]:
    """Ranked as in the table; orientation in rad."""
    listed = []
    for p in sensitivity.parameters:
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


def show_observability(to: Reporter, model: Model, observability: Observability, rows: int) -> None:
    """Expected uncertainties, figures of merit, and what is not told apart."""
    directions, selected = observability.directions, observability.selected
    table = []
    for name, std, alone, gone in zip(
        selected, observability.std, observability.alone, directions.undetermined(), strict=True
    ):
        p, unit = model.parameters[model.names.index(name)], parameter_unit(model, name)
        shown = "undetermined" if gone else f"{std / unit.scale:.3g} {unit.text}"
        share = "" if gone else f"{std / p.range:.3f}"
        remark = "" if gone or std < p.range / 2 else "no better than its stated range"
        if not gone and alone > _WIDER * std:
            remark = f"weak: {alone / unit.scale:.3g} {unit.text} from the data alone; held by its range"
        table.append((name, f"+-{p.range / unit.scale:.4g} {unit.text}", shown, share, remark))
    values = count(observability.count, "measured value")
    title = f"Expected standard uncertainty from {values} in {count(rows, 'position')}"
    to.table(title, ("parameter", "range", "standard uncertainty", "std/range", "remark"), table)
    to.say()
    if observability.datum is not None:
        to.say(observability.datum.text)
        if observability.datum.missing:
            to.say(f"declare what defines the base: `datum: [{', '.join(observability.datum.proposed)}]`")
    to.say(f"rank: {directions.rank} of {len(selected)}")
    paper, whitened = short(observability.condition_number), short(directions.condition_number)
    to.say(f"condition number: {paper} (Js of the paper), {whitened} (whitened)")
    to.say(", ".join(f"{k} {short(v)}" for k, v in observability.indices.items()))
    to.say("singular values (whitened): " + " ".join(short(float(v)) for v in directions.singular_values))
    for c in observability.undetermined:
        head = "undetermined" if c.kind == "null" else "weak"
        for text in c.texts:
            to.say(f"{head}: {text}")
        to.say(f"help: {_advice(c)}")


def _advice(c: Combination) -> str:
    """Which parameters to drop, or what to measure otherwise."""
    if len(c.names) == 1:
        return f"leave it out, `{without(c)}`, or measure where it has an effect"
    directly = "it" if len(c.hold) == 1 else "them"
    return f"fix {hold_text(c)}, measure {directly} directly, or spread the positions"


def observability_json(model: Model, observability: Observability, rows: int) -> dict[str, Any]:
    """Figures of merit; uncertainties in each parameter's unit, null where undetermined."""
    parameters = []
    for name, std, alone in zip(observability.selected, observability.std, observability.alone, strict=True):
        unit = parameter_unit(model, name)
        values = {"std": finite(std / unit.scale), "std_of_data": finite(alone / unit.scale)}
        parameters.append({"name": name, **values, "unit": unit.text})
    return {
        "n_rows": rows,
        "n_values": observability.count,
        "condition_number": finite(observability.condition_number),
        "condition_number_whitened": finite(observability.directions.condition_number),
        "rank": observability.directions.rank,
        "singular_values": [float(v) for v in observability.directions.singular_values],
        **{name: finite(value) for name, value in observability.indices.items()},
        "parameters": parameters,
        "datum": None if observability.datum is None else list(observability.datum.held),
        "gauge": [] if observability.datum is None else list(observability.datum.gauge.motions),
        "undetermined": [each for c in observability.undetermined for each in combination_json(model, c)],
    }
