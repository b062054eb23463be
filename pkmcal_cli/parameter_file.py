"""Parameter files: identified values with uncertainty, correlations and provenance; read by `-p` of every command."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from .errors import BadInput, Fault, FaultList, did_you_mean
from .unit_text import UnitError, parse_unit, parse_value
from .yaml_source import read_source
from .yaml_tree import SourceMap, SourceNode

if TYPE_CHECKING:
    from collections.abc import Sequence

    from .model import ModelParameter


@dataclass(frozen=True)
class ParameterEntry:
    """One parameter of a file: value and standard uncertainty in `unit`; std None where undetermined."""

    name: str
    value: float
    std: float | None
    unit: str
    identified: bool


def dump_parameters(
    entries: Sequence[ParameterEntry],
    correlations: tuple[Sequence[str], Sequence[Sequence[float]]],
    provenance: Mapping[str, Any],
) -> str:
    """The text of a parameter file."""
    import yaml

    lines = ["# Parameters identified by pkmcal; `-p FILE` takes them in every command."]
    lines.append(yaml.safe_dump({"provenance": dict(provenance)}, sort_keys=False, allow_unicode=True).rstrip())
    lines.append("parameters:")
    for e in entries:
        std = "null" if e.std is None else repr(e.std)
        unit = f", unit: {_scalar(e.unit)}" if e.unit not in ("", "1") else ""
        identified = "true" if e.identified else "false"
        lines.append(f"  {e.name}: {{value: {e.value!r}, std: {std}{unit}, identified: {identified}}}")
    names, matrix = correlations
    if names:
        lines.append("correlations:")
        lines.append(f"  names: [{', '.join(names)}]")
        lines.append("  matrix:")
        lines += [f"    - [{', '.join(_number(v) for v in row)}]" for row in matrix]
    return "\n".join(lines) + "\n"


def _scalar(text: str) -> str:
    import yaml

    return str(yaml.safe_dump(text, default_flow_style=True)).split("\n")[0]


def _number(value: float) -> str:
    return "null" if math.isnan(value) else f"{value:.6g}"


def read_parameters(path: str, parameters: Sequence[ModelParameter]) -> dict[str, float]:
    """Values (SI) by name of a parameter file; parameters that it lacks stay nominal.

    Entries are `{value, unit, ...}`, a number in the parameter's unit, or a text with a unit. Raises BadInput with
    all faults.
    """
    source = read_source(path)
    tree = SourceMap(source.root, {path: source.lines})
    faults = FaultList()
    for fault in source.faults:
        faults.add(fault)
    known = {p.name: p for p in parameters}
    section = source.root.child("parameters") if isinstance(source.root.value, dict) else None
    if section is None or not isinstance(section.value, dict):
        hint = "a parameter file has a map `parameters:`; `pkmcal calibrate -o` writes one"
        raise BadInput([tree.fault("parameters", "no map `parameters` in this file", (), hint)])
    values = {}
    for name, node in section.value.items():
        if name not in known:
            what = f"the machine has no parameter `{name}`"
            faults.add(tree.fault("name", what, ("parameters", name), did_you_mean(name, known), at_key=True))
            continue
        value = _entry_value(tree, name, node, known[name], faults)
        if value is not None:
            values[name] = value
    faults.raise_if_any()
    return values


def _entry_value(
    tree: SourceMap, name: str, node: SourceNode, parameter: ModelParameter, faults: FaultList
) -> float | None:
    """One entry in SI, or None and a fault."""
    path: tuple[str | int, ...] = ("parameters", name)
    unit_text, raw = parameter.unit, node.value
    if isinstance(raw, dict):
        value_node, unit_node = raw.get("value"), raw.get("unit")
        if value_node is None:
            faults.add(tree.fault("missing-key", f"`{name}` has no `value`", path, "value: a number"))
            return None
        raw, path = value_node.value, (*path, "value")
        unit_text = str(unit_node.value) if unit_node is not None else unit_text
    fault: Fault | None = None
    try:
        if isinstance(raw, str):
            number, unit = parse_value(raw)
        elif isinstance(raw, int | float) and not isinstance(raw, bool):
            number, unit = float(raw), parse_unit(unit_text or "1")
        else:
            fault = tree.fault("type", f"`{name}` wants a number or a text with a unit", path)
            number, unit = 0.0, parse_unit("1")
        if fault is None and not unit.dimension.fits(parse_unit(parameter.unit or "1").dimension):
            what = f"`{unit.text}` is a unit of {unit.dimension}, `{name}` is a {parameter.dimension}"
            fault = tree.fault("unit", what, path, f"a value in {parameter.unit or 'no unit'}")
        if fault is None and not math.isfinite(number):
            fault = tree.fault("value", f"`{name}` wants a finite number", path)
    except UnitError as error:
        fault = tree.fault("unit", error.what, path, error.hint)
    except ValueError as error:
        fault = tree.fault("value", str(error), path, "a number, or a text with a unit such as \"12.5 mm\"")
    if fault is not None:
        faults.add(fault)
        return None
    return unit.to_si(number)
