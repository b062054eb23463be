"""Parameter files: identified values, their uncertainty, of which machine and where from; read by `-p` everywhere."""

from __future__ import annotations

import math
from collections.abc import Collection, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING

from pkmcal_cli import __version__
from pkmcal_cli.base.errors import BadInput, FaultList, did_you_mean
from pkmcal_cli.language.fingerprint import Fingerprint, read_fingerprint
from pkmcal_cli.loading.data_information import DATA
from pkmcal_cli.loading.ending import Ending, read_ending
from pkmcal_cli.loading.evidence import MEASURED, UNEXPLAINED, Evidence, read_evidence
from pkmcal_cli.loading.parameter_text import ERRORS, FINGERPRINT
from pkmcal_cli.units.dimensions import Dimension
from pkmcal_cli.units.unit_text import UNITS, Unit, UnitError, parse_unit, parse_value
from pkmcal_cli.yaml_source.read import read_source
from pkmcal_cli.yaml_source.tree import SourceMap, SourceNode

if TYPE_CHECKING:
    from collections.abc import Sequence

    from pkmcal_cli.base.rotation import Array
    from pkmcal_cli.model.parts import ModelParameter


_SECTIONS = ("provenance", FINGERPRINT, "parameters", MEASURED, UNEXPLAINED, ERRORS, "correlations", DATA)
_NOT_HERE = "remove it, or check that this file belongs to this machine"
_LISTED = 3  # effects in a hint
_ENTRY = ("value", "std", "unit", "identified", "note")


@dataclass(frozen=True, kw_only=True)
class ParameterFile:
    """What a parameter file says: SI values by name; how the fit that wrote it ended; the file's checksum.

    covariance: names and matrix (p, p), SI; None where the file has none. others: values of sessions that are not
    here. of_machine: whether it says of which machine it is; that is then the right one. spoilt: whether there are
    `correlations` that are not whole.
    """

    file: str
    values: Mapping[str, float]
    ending: Ending
    sha256: str
    covariance: tuple[tuple[str, ...], Array] | None = None
    others: tuple[str, ...] = ()
    of_machine: bool = True
    spoilt: bool = False
    evidence: Evidence | None = None


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
        hint = "add a map `parameters:`; `pkmcal calibrate -o FILE` writes a parameter file"
        raise BadInput([tree.fault("parameters", "this file has no map `parameters`", (), hint)])
    _unknown_keys(tree, source.root, (), _SECTIONS, faults)
    values, others = _values(tree, section.value, known, parameters, faults)
    evidence = read_evidence(tree, faults)
    faults.raise_if_any()
    return ParameterFile(
        file=source.file,
        values=values,
        ending=read_ending(source.root),
        sha256=source.sha256,
        covariance=_covariance(source.root.child("correlations"), known),
        others=others,
        of_machine=of_machine,
        spoilt=not _is_whole(source.root.child("correlations")),
        evidence=evidence,
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
            message = f"the machine has no parameter `{name}`"
            remedy = _without_effect(tree, name, known) or did_you_mean(name, known, _NOT_HERE)
            faults.add(tree.fault("name", message, ("parameters", name), remedy, at_key=True))
            continue
        value = _entry_value(tree, name, node, known[name], faults)
        if value is not None:
            values[name] = value
    return values, tuple(others)


def _without_effect(tree: SourceMap, name: str, known: Collection[str]) -> str | None:
    """What to do with a number of an effect that the machine file lacks; None for other names."""
    effect = name.rpartition(".")[0]
    if "@" not in effect or any(each.rpartition(".")[0] == effect for each in known):
        return None
    calibrated = _inputs(tree.root)
    named = f", as `{calibrated[0]}`, of which these values are" if calibrated else ""
    return f"give the machine file with the effect `{effect}`{named}; to use the other values, remove this entry"


def _inputs(root: SourceNode) -> list[str]:
    """Files that the values are made from, the machine file first; none where the file does not say."""
    provenance = root.child("provenance")
    plain = None if provenance is None else provenance.plain()
    inputs = plain.get("inputs") if isinstance(plain, dict) else None
    return [str(name) for name in inputs] if isinstance(inputs, dict) else []


def _is_of(machine: Fingerprint, tree: SourceMap) -> bool:
    """Whether the file has the machine's fingerprint, or none. Raises BadInput where it is of another machine."""
    node = tree.root.child(FINGERPRINT)
    if node is None or node.value is None:
        return False
    try:
        fingerprint = read_fingerprint(node.plain())
    except ValueError:
        message, remedy = "this is not the fingerprint of a machine", "delete the line"
    else:
        difference = machine.difference(fingerprint)
        if difference is None:
            return True
        message = f"these values belong to another machine, `{fingerprint.of}`; `{machine.of}` differs ({difference})"
        if fingerprint.of == machine.of:
            message = f"these values belong to an earlier version of `{machine.of}` ({difference})"
        remedy = _remedy(machine, fingerprint)
    raise BadInput([tree.fault(FINGERPRINT, message, (FINGERPRINT,), remedy, at_key=True)])


def _remedy(machine: Fingerprint, of_file: Fingerprint) -> str:
    """What to do with values of another machine."""
    lacking = [f"`{effect}`" for effect in of_file.effects if effect not in machine.effects]
    if not lacking:
        return "use the machine that they belong to; to accept them anyway, delete this line"
    effects = ", ".join(lacking[:_LISTED]) + (" ..." if len(lacking) > _LISTED else "")
    named = "" if of_file.of in ("", machine.of) else f"`{of_file.of}`, "
    others = "to use the other values, delete this line and the entries of these effects in `parameters`"
    return f"give {named}the machine file that declares {effects}; {others}"


def _of_a_session(name: str, parameters: Sequence[ModelParameter]) -> bool:
    """Whether a parameter is of a session that is not here, or of none where every session has its own."""
    named = {p.shared_name for p in parameters if p.session}
    shared = {p.name for p in parameters if p.per_session} | named
    return name in named or (name.endswith("]") and name.partition("[")[0] in shared)


def _covariance(node: SourceNode | None, known: Mapping[str, ModelParameter]) -> tuple[tuple[str, ...], Array] | None:
    """Names and covariance, SI, of the section `correlations`; None where it is not whole."""
    import numpy as np

    raw = node.plain() if node is not None else None
    if not isinstance(raw, dict) or not {"names", "std", "matrix"} <= raw.keys() or not isinstance(raw["names"], tuple):
        return None
    every = tuple(str(n) for n in raw["names"])
    keep = [k for k, n in enumerate(every) if n in known]
    names = tuple(every[k] for k in keep)
    try:
        scale = np.array([parse_unit(known[n].unit or "1").scale for n in names])
        std, matrix = np.array(raw["std"], dtype=float), np.array(raw["matrix"], dtype=float)
    except (KeyError, TypeError, ValueError):
        return None
    if std.shape != (len(every),) or matrix.shape != (len(every), len(every)) or not (std >= 0).all():
        return None
    std, matrix = std[keep], matrix[np.ix_(keep, keep)]
    return names, matrix * np.outer(std * scale, std * scale)


def _is_whole(node: SourceNode | None) -> bool:
    """Whether names, std and matrix of a section `correlations` are of one size, or there is nothing in it."""
    raw = node.plain() if node is not None else None
    parts = [raw.get(key) for key in ("names", "std", "matrix")] if isinstance(raw, dict) else [raw]
    sizes = {len(part) if isinstance(part, tuple) else -1 for part in parts}
    return not raw or (len(sizes) == 1 and -1 not in sizes)


def _unknown_keys(
    tree: SourceMap, node: SourceNode, path: tuple[str, ...], known: Sequence[str], faults: FaultList
) -> None:
    """Keys that would be passed over are faults."""
    assert isinstance(node.value, dict)
    for key in node.value:
        if key not in known:
            message = f"unknown key `{key}`" + (f" in `{path[-1]}`" if path else "")
            remedy = _other_release(tree.root) or did_you_mean(key, known)
            faults.add(tree.fault("unknown-key", message, (*path, key), remedy, at_key=True))


def _other_release(root: SourceNode) -> str | None:
    """What to do with a file that another release has written; None for one of this release, or of nobody."""
    provenance = root.child("provenance") if isinstance(root.value, dict) else None
    program = provenance.child("program") if provenance is not None and isinstance(provenance.value, dict) else None
    this_program = f"pkmcal {__version__}"
    if program is None or not isinstance(program.value, str) or program.value == this_program:
        return None
    return f"the file was written by {program.value[:40]}, this is {this_program}: use that release, or calibrate again"


def _entry_value(
    tree: SourceMap, name: str, node: SourceNode, parameter: ModelParameter, faults: FaultList
) -> float | None:
    """One entry in SI, or None and a fault."""
    path: tuple[str | int, ...] = ("parameters", name)
    unit_text, raw, unit_path = parameter.unit, node.value, path
    if isinstance(raw, dict):
        _unknown_keys(tree, node, ("parameters", name), _ENTRY, faults)
        value_node, unit_node = raw.get("value"), raw.get("unit")
        if value_node is None:
            faults.add(tree.fault("missing-key", f"`{name}` has no `value`", path, "add `value: NUMBER`", at_key=True))
            return None
        named = unit_node is not None and not isinstance(value_node.value, str)
        raw, path, unit_path = value_node.value, (*path, "value"), (*path, "unit" if named else "value")
        if unit_node is not None:
            unit_text = unit_node.value if isinstance(unit_node.value, str) else " "  # no unit: told when it is read
    expected = parse_unit(parameter.unit or "1").dimension
    remedy = f"give `{name}` in {parameter.unit}" if parameter.unit else f"give `{name}` without a unit"
    try:
        number, unit = _number_and_unit(raw, unit_text, expected)
    except UnitError as error:
        faults.add(tree.fault("unit", error.message, unit_path, error.hint or remedy))
        return None
    except (ValueError, OverflowError):
        message = f"`{name}` must be a finite number or a text with a unit"
        faults.add(tree.fault("value", message, path, 'write, for example, 12.5 or "12.5 mm"'))
        return None
    if not unit.dimension.fits(expected):
        message = f"`{unit.text}` is a unit of {unit.dimension}, not of {parameter.dimension}"
        faults.add(tree.fault("unit", message, unit_path, remedy))
        return None
    return unit.to_si(number)


def _number_and_unit(raw: object, unit_text: str, expected: Dimension) -> tuple[float, Unit]:
    """A value and its unit. Raises UnitError, ValueError, OverflowError."""
    if isinstance(raw, bool) or not isinstance(raw, int | float | str):
        raise ValueError("no number")
    number, unit = parse_value(raw, (expected,)) if isinstance(raw, str) else (float(raw), UNITS["1"])
    unit = parse_unit(unit_text or "1", (expected,)) if unit.text == "1" else unit
    if not math.isfinite(unit.to_si(number)):
        raise ValueError("not finite")
    return number, unit
