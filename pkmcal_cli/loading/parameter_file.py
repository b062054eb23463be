"""Parameter files: identified values, their uncertainty, of which machine and where from; read by `-p` everywhere."""

from __future__ import annotations

import json
import math
import re
from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from pkmcal_cli.base.errors import BadInput, FaultList, did_you_mean
from pkmcal_cli.language.fingerprint import Fingerprint, read_fingerprint
from pkmcal_cli.units.unit_text import Unit, UnitError, parse_unit, parse_value
from pkmcal_cli.yaml_source.read import read_source
from pkmcal_cli.yaml_source.tree import SourceMap, SourceNode

if TYPE_CHECKING:
    from collections.abc import Sequence

    from pkmcal_cli.base.rotation import Array
    from pkmcal_cli.model.model import ModelParameter


_FINGERPRINT = "fingerprint"
_SECTIONS = ("provenance", _FINGERPRINT, "parameters", "correlations")
_ENTRY = ("value", "std", "unit", "identified", "note")
_NEIGHBOURS = 3  # floating-point numbers on either side that are tried


@dataclass(frozen=True)
class ParameterEntry:
    """One parameter of a file: value and standard uncertainty in `unit`; std None where undetermined.

    note: why it is not (well) identified, "" for nothing to say.
    """

    name: str
    value: float
    std: float | None
    unit: str
    identified: bool
    note: str = ""


@dataclass(frozen=True)
class Correlations:
    """Of identified parameters: standard uncertainties (p,) in their units, never infinite; matrix (p, p)."""

    names: Sequence[str]
    std: Sequence[float]
    matrix: Sequence[Sequence[float]]


def exact_value(si: float, unit: Unit) -> float:
    """The number in `unit` with the fewest digits that reads back as `si`, bit by bit where there is one."""
    near = unit.from_si(si)
    tries = [near]
    for direction in (-math.inf, math.inf):
        value = near
        for _ in range(_NEIGHBOURS):
            value = math.nextafter(value, direction)
            tries.append(value)
    exact = [v for v in tries if unit.to_si(v) == si]
    return min(exact, key=lambda v: (len(repr(v)), abs(v - near))) if exact else near


def dump_parameters(
    entries: Sequence[ParameterEntry],
    correlations: Correlations | None,
    provenance: Mapping[str, Any],
    fingerprint: Fingerprint,
) -> str:
    """The text of a parameter file; `fingerprint`: of the machine that the values belong to."""
    import yaml

    lines = [
        "# Parameters identified by pkmcal; `-p FILE` takes them in every command.",
        f"# Without the line `{_FINGERPRINT}` they are taken for every machine that has parameters of these names.",
    ]
    head = yaml.safe_dump({"provenance": dict(provenance)}, sort_keys=False, allow_unicode=True, width=1000)
    lines += [head.rstrip(), f"{_FINGERPRINT}: {fingerprint.line()}", "parameters:"]
    for e in entries:
        std = "null" if e.std is None else _real(e.std)
        unit = f", unit: {scalar(e.unit)}" if e.unit not in ("", "1") else ""
        identified = "true" if e.identified else "false"
        note = f", note: {json.dumps(e.note, ensure_ascii=False)}" if e.note else ""
        entry = f"value: {_real(e.value)}, std: {std}{unit}, identified: {identified}{note}"
        lines.append(f"  {scalar(e.name)}: {{{entry}}}")
    if correlations is not None:
        lines.append("correlations: # std: with what is held at its prior, so that all can be carried on")
        lines.append(f"  names: [{', '.join(scalar(n) for n in correlations.names)}]")
        lines.append(f"  std: [{', '.join(_real(v) for v in correlations.std)}]")
        lines.append("  matrix:")
        lines += [f"    - [{', '.join(_number(v) for v in row)}]" for row in correlations.matrix]
    return "\n".join(lines) + "\n"


_PLAIN = re.compile(r"[A-Za-z][A-Za-z0-9_/^*]*")
_WORDS = frozenset(["y", "n", "yes", "no", "true", "false", "on", "off", "null"])  # other readers convert these


def scalar(text: str) -> str:
    """A text as a YAML scalar, quoted where it could be taken for something else."""
    return text if _PLAIN.fullmatch(text) and text.lower() not in _WORDS else json.dumps(text, ensure_ascii=False)


def _real(value: float) -> str:
    """A number that every YAML reader takes for one: 1.0e-06, not 1e-06."""
    text = repr(value)
    return text.replace("e", ".0e") if "e" in text and "." not in text else text


def _number(value: float) -> str:
    return "null" if math.isnan(value) else f"{value:.12g}"


@dataclass(frozen=True, kw_only=True)
class ParameterFile:
    """What a parameter file says: SI values by name; how the fit that wrote it ended; the file's checksum.

    covariance: names and matrix (p, p), SI; None where the file has none. others: values of sessions that are not
    here. of_machine: whether it says of which machine it is; that is then the right one.
    """

    file: str
    values: Mapping[str, float]
    status: str | None
    sha256: str
    covariance: tuple[tuple[str, ...], Array] | None = None
    others: tuple[str, ...] = ()
    of_machine: bool = True


def read_parameters(path: str, parameters: Sequence[ModelParameter], machine: Fingerprint) -> ParameterFile:
    """A parameter file of a machine; parameters that it lacks stay nominal.

    Entries are `{value, unit, ...}`, a number in the parameter's unit, or a text with a unit. Raises BadInput with
    all faults, and for another machine's file with this fault alone.
    """
    source = read_source(path, "a parameter file", "parameters:")
    tree = SourceMap(source.root, {source.file: source.lines})
    of_machine = _is_of(machine, tree)
    faults = FaultList()
    for fault in source.faults:
        faults.add(fault)
    known = {p.name: p for p in parameters}
    section = source.root.child("parameters") if isinstance(source.root.value, dict) else None
    if section is None or not isinstance(section.value, dict):
        hint = "a parameter file has a map `parameters:`; `pkmcal calibrate -o FILE` writes one"
        raise BadInput([tree.fault("parameters", "no map `parameters` in this file", (), hint)])
    _unknown_keys(tree, source.root, (), _SECTIONS, faults)
    values, others = _values(tree, section.value, known, parameters, faults)
    faults.raise_if_any()
    return ParameterFile(
        file=source.file,
        values=values,
        status=_status(source.root.child("provenance")),
        sha256=source.sha256,
        covariance=_covariance(source.root.child("correlations"), known),
        others=others,
        of_machine=of_machine,
    )


def _values(
    tree: SourceMap,
    entries: Mapping[str, SourceNode],
    known: Mapping[str, ModelParameter],
    parameters: Sequence[ModelParameter],
    faults: FaultList,
) -> tuple[dict[str, float], tuple[str, ...]]:
    """Values, SI, by name; names of other sessions' parameters."""
    values: dict[str, float] = {}
    others: list[str] = []
    for name, node in entries.items():
        if name not in known and _of_a_session(name, parameters):
            others.append(name)
            continue
        if name not in known:
            what = f"the machine has no parameter `{name}`"
            remedy = did_you_mean(name, known, "take it out; is this file of another machine?")
            faults.add(tree.fault("name", what, ("parameters", name), remedy, at_key=True))
            continue
        value = _entry_value(tree, name, node, known[name], faults)
        if value is not None:
            values[name] = value
    return values, tuple(others)


def _status(provenance: SourceNode | None) -> str | None:
    """How the fit ended that wrote the file."""
    status = None if provenance is None else provenance.child("status")
    return None if status is None else str(status.value)


def _is_of(machine: Fingerprint, tree: SourceMap) -> bool:
    """Whether the file has the machine's fingerprint, or none. Raises BadInput where it is of another machine."""
    node = tree.root.child(_FINGERPRINT)
    if node is None or node.value is None:
        return False
    try:
        found = read_fingerprint(node.plain())
    except ValueError:
        what, remedy = "this is no fingerprint of a machine", "delete the line"
    else:
        difference = machine.difference(found)
        if difference is None:
            return True
        what = f"these values belong to another machine, `{found.of}`: `{machine.of}` {difference}"
        if found.of == machine.of:
            what = f"these values belong to `{machine.of}` as it was: now it {difference}"
        remedy = "give the machine that they belong to; to take them all the same, delete this line"
    raise BadInput([tree.fault(_FINGERPRINT, what, (_FINGERPRINT,), remedy, at_key=True)])


def _of_a_session(name: str, parameters: Sequence[ModelParameter]) -> bool:
    """Whether a parameter is the instance, for a session that is not here, of one that every session has."""
    shared = name.partition("[")[0]
    mine = {p.name for p in parameters if p.per_session} | {p.shared_name for p in parameters if p.session}
    return name.endswith("]") and shared in mine


def _covariance(node: SourceNode | None, known: Mapping[str, ModelParameter]) -> tuple[tuple[str, ...], Array] | None:
    """Names and covariance, SI, of the section `correlations`; None where it is not whole."""
    import numpy as np

    raw = node.plain() if node is not None else None
    if not isinstance(raw, dict) or not {"names", "std", "matrix"} <= raw.keys():
        return None
    every = tuple(str(n) for n in raw["names"])
    keep = [k for k, n in enumerate(every) if n in known]
    names = tuple(every[k] for k in keep)
    try:
        scale = np.array([parse_unit(known[n].unit or "1").scale for n in names])
        std, matrix = np.array(raw["std"], dtype=float), np.array(raw["matrix"], dtype=float)
    except (KeyError, TypeError, ValueError):
        return None
    if std.shape != (len(every),) or matrix.shape != (len(every), len(every)):
        return None
    std, matrix = std[keep], matrix[np.ix_(keep, keep)]
    return names, matrix * np.outer(std * scale, std * scale)


def _unknown_keys(
    tree: SourceMap, node: SourceNode, path: tuple[str, ...], known: Sequence[str], faults: FaultList
) -> None:
    """Keys that would be passed over are faults."""
    assert isinstance(node.value, dict)
    for key in node.value:
        if key not in known:
            what = f"unknown key `{key}`" + (f" of `{path[-1]}`" if path else "")
            faults.add(tree.fault("unknown-key", what, (*path, key), did_you_mean(key, known), at_key=True))


def _entry_value(
    tree: SourceMap, name: str, node: SourceNode, parameter: ModelParameter, faults: FaultList
) -> float | None:
    """One entry in SI, or None and a fault."""
    path: tuple[str | int, ...] = ("parameters", name)
    unit_text, raw = parameter.unit, node.value
    unit_path = path
    if isinstance(raw, dict):
        _unknown_keys(tree, node, ("parameters", name), _ENTRY, faults)
        value_node, unit_node = raw.get("value"), raw.get("unit")
        if value_node is None:
            faults.add(tree.fault("missing-key", f"`{name}` has no `value`", path, "value: a number", at_key=True))
            return None
        named = unit_node is not None and not isinstance(value_node.value, str)
        raw, path, unit_path = value_node.value, (*path, "value"), (*path, "unit" if named else "value")
        unit_text = str(unit_node.value) if unit_node is not None else unit_text
    try:
        number, unit = _number_and_unit(raw, unit_text)
    except UnitError as error:
        faults.add(tree.fault("unit", error.what, unit_path, error.hint))
        return None
    except (ValueError, OverflowError):
        what = f"`{name}` wants a finite number or a text with a unit"
        faults.add(tree.fault("value", what, path, 'for example 12.5 or "12.5 mm"'))
        return None
    if not unit.dimension.fits(parse_unit(parameter.unit or "1").dimension):
        what = f"`{unit.text}` is a unit of {unit.dimension}, not of {parameter.dimension}"
        faults.add(tree.fault("unit", what, unit_path, f"`{name}` is given in {parameter.unit or 'no unit'}"))
        return None
    return unit.to_si(number)


def _number_and_unit(raw: object, unit_text: str) -> tuple[float, Unit]:
    """A value and its unit. Raises UnitError, ValueError, OverflowError."""
    if isinstance(raw, str):
        number, unit = parse_value(raw)
        unit = parse_unit(unit_text or "1") if unit.text == "1" else unit
    elif isinstance(raw, int | float) and not isinstance(raw, bool):
        number, unit = float(raw), parse_unit(unit_text or "1")
    else:
        raise ValueError("no number")
    if not math.isfinite(unit.to_si(number)):
        raise ValueError("not finite")
    return number, unit
