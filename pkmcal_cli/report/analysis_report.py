"""The results of `sensitivity` and `observability`: tables and JSON."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from pkmcal_cli.base.plural import count
from pkmcal_cli.calibration.identifiability import Combination
from pkmcal_cli.calibration.mean_sensitivity import NO_SHIFT, ParameterSensitivity, Sensitivity, ranked
from pkmcal_cli.calibration.observability_indices import Observability
from pkmcal_cli.model.model import Model
from pkmcal_cli.report.console import Reporter, bar
from pkmcal_cli.report.number_format import finite, readable, short, to_digits
from pkmcal_cli.report.parameters import combination_json, hold_text, parameter_unit, without
from pkmcal_cli.units.file_units import FileUnits, Unit

_WIDER = 1.5  # times the stated uncertainty: what data alone would tell is worth a word

UNSTRAINED = (
    "note: all parameters are at nominal, so the machine is hardly strained and effects that act through forces "
    "look invisible; use identified parameters: `-p PARAMS.yaml`"
)


def show_sensitivity(to: Reporter, model: Model, units: FileUnits, result: Sensitivity, word: str) -> None:
    """Ranked table with bars; word: what a size is, "range" or "size"."""
    largest = max((ranked(p.position) for p in result.parameters), default=0.0) or 1.0
    table = []
    for p in result.parameters:
        shift, rotation = _shift(p.position, units.length), _shift(p.orientation, units.angle)
        table.append((p.name, _size(model, p), shift, bar(ranked(p.position) / largest), rotation))
    rows = count(int(result.prediction.solved.sum()), "position")
    title = f"Mean TCP shift and rotation per parameter {word}, {rows} (eq. 23)"
    to.table(title, ("parameter", word, "shift", "", "rotation"), table, spare=("",))


def show_along(to: Reporter, model: Model, units: FileUnits, result: Sensitivity, word: str, coordinate: str) -> None:
    """The same of one coordinate: its mean shift, with its sign, and the largest one."""
    unit = unit_along(units, coordinate)
    every = dict(zip(result.names, zip(*result.along(coordinate), strict=True), strict=True))
    longest = max((ranked(float(mean)) for mean, _ in every.values()), default=0.0) or 1.0
    table = []
    for p in sorted(result.parameters, key=lambda p: (-ranked(float(every[p.name][0])), p.name)):
        mean, most = (float(shift) for shift in every[p.name])
        table.append((p.name, _size(model, p), _shift(mean, unit), bar(ranked(mean) / longest), _shift(most, unit)))
    rows = count(int(result.prediction.solved.sum()), "position")
    title = f"Shift of {coordinate} per parameter {word}, {rows}"
    to.table(title, ("parameter", word, "mean", "", "largest"), table, spare=("",))


def _shift(value: float, unit: Unit) -> str:
    """A shift, m or rad; rounding errors are none."""
    return readable(value if abs(value) > NO_SHIFT else 0.0, unit)


def unit_along(units: FileUnits, coordinate: str) -> Unit:
    """Unit of a coordinate of the tool point."""
    return units.angle if coordinate.startswith("r") else units.length


def _size(model: Model, parameter: ParameterSensitivity) -> str:
    unit = parameter_unit(model, parameter.name)
    return f"+-{to_digits(parameter.size / unit.scale, 4)} {unit.text}"


def sensitivity_json(model: Model, units: FileUnits, result: Sensitivity, coordinate: str | None) -> dict[str, Any]:
    """Ranked by the shift of the TCP; orientation in rad."""
    ranges = {p.name: p.range for p in model.parameters}
    along = {n: {"mean": None, "largest": None, "channel_unit": None} for n in result.names}
    if coordinate is not None:
        along = _along_json(result, coordinate, unit_along(units, coordinate))
    listed = []
    for p in result.parameters:
        file_unit = parameter_unit(model, p.name)
        listed.append(
            {
                "name": p.name,
                "position": finite(p.position / units.length.scale),
                "orientation": finite(p.orientation),
                "unit": units.length.text,
                "orientation_unit": "rad",
                "range": ranges[p.name] / file_unit.scale,
                "range_unit": file_unit.text,
                "size": p.size / file_unit.scale,
                **along[p.name],
            }
        )
    rows = int(result.prediction.solved.sum())
    return {"n_rows": rows, "channel": coordinate, "parameters": listed}


def _along_json(result: Sensitivity, coordinate: str, unit: Unit) -> dict[str, dict[str, Any]]:
    """Mean and largest shift of one coordinate, by parameter."""
    return {
        name: {"mean": finite(mean / unit.scale), "largest": finite(largest / unit.scale), "channel_unit": unit.text}
        for name, mean, largest in zip(result.names, *(a.tolist() for a in result.along(coordinate)), strict=True)
    }


def show_observability(to: Reporter, model: Model, observability: Observability, rows: int) -> None:
    """Expected uncertainties, figures of merit, and what is not told apart."""
    directions, selected = observability.directions, observability.selected
    table = []
    for name, std, alone, gone in zip(
        selected, observability.std, observability.alone, directions.undetermined(), strict=True
    ):
        p, unit = model.parameters[model.names.index(name)], parameter_unit(model, name)
        shown = "undetermined" if gone else f"{to_digits(std / unit.scale, 3)} {unit.text}"
        share = "" if gone else f"{std / p.range:.3f}"
        remark = "" if gone or std < p.range / 2 else "no better than its stated range"
        if not gone and held_by_range(std, alone):
            remark = f"weak: {to_digits(alone / unit.scale, 3)} {unit.text} from the data alone; held by its range"
        table.append((name, f"+-{to_digits(p.range / unit.scale, 4)} {unit.text}", shown, share, remark))
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
    weak = [c for c in observability.undetermined if c.kind != "null"]
    for c in (c for c in observability.undetermined if c.kind == "null"):
        for text in c.texts:
            to.say(f"undetermined: {text}")
        to.say(f"help: {_advice(c)}")
    for c in weak:
        to.say(f"weak: {c.text}")
    if weak:
        to.say(f"help: {_advice(weak[0]) if len(weak) == 1 else _advice_on_weak(weak)}")


def held_by_range(std: float, by_data: float) -> bool:
    """Whether data alone would tell much less of a parameter than is stated with its range."""
    return by_data > _WIDER * std


def _advice(c: Combination) -> str:
    """Which parameters to drop, or what to measure otherwise."""
    if len(c.names) == 1:
        return f"leave it out, `{without(c.hold)}`, or measure where it has an effect"
    directly = "it" if len(c.hold) == 1 else "them"
    return f"fix {hold_text(c)}, measure {directly} directly, or spread the positions"


def _advice_on_weak(weak: Sequence[Combination]) -> str:
    """The same for several weak combinations, a parameter of each."""
    held = tuple(dict.fromkeys(name for c in weak for name in c.hold))
    return f"their ranges hold them; fix some, e.g. `{without(held)}`, measure them directly, or spread the positions"


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
