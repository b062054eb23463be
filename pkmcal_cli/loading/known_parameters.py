"""Parameter files read for what they say by name, of whatever machine: priors and comparisons."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from datetime import UTC, datetime
from typing import TYPE_CHECKING, Any

import numpy as np

from pkmcal_cli.base.errors import FaultList
from pkmcal_cli.language.fingerprint import Fingerprint, read_fingerprint
from pkmcal_cli.loading.data_information import DATA, DataInformation, Values, read_data
from pkmcal_cli.loading.ending import Ending, read_ending
from pkmcal_cli.loading.evidence import Evidence, read_evidence
from pkmcal_cli.loading.kept_errors import KeptErrors, read_errors
from pkmcal_cli.loading.parameter_text import FINGERPRINT
from pkmcal_cli.units.dimensions import Dimension
from pkmcal_cli.units.unit_text import Unit, UnitError, parse_unit, parse_value
from pkmcal_cli.yaml_source.read import read_source
from pkmcal_cli.yaml_source.tree import SourceMap, SourceNode

if TYPE_CHECKING:
    from pkmcal_cli.base.rotation import Array


_ROUNDING = 1e-6
_WRITE = "write it with `pkmcal calibrate -o`"


@dataclass(frozen=True)
class KnownParameter:
    """Value and standard uncertainty, SI (nan: not known), of a parameter; whether it was identified; its unit.

    asked: whether a fit was to identify it, determined or not; the others have neither `std` nor `note`.
    """

    value: float
    std: float
    identified: bool
    unit: Unit
    asked: bool = False


@dataclass(frozen=True, kw_only=True)
class KnownParameters:
    """What a parameter file says, SI: parameters by name; covariance (p, p) of `names`; what its rows say.

    created: when, None where it does not say; measured: dates of the first and last row, None where the table had none;
    inputs: sha256 by file; ending: of the fit; errors: those it left.
    """

    file: str
    sha256: str
    parameters: Mapping[str, KnownParameter]
    names: tuple[str, ...]
    covariance: Array | None
    data: DataInformation | None
    fingerprint: Fingerprint | None
    created: datetime | None
    inputs: Mapping[str, str]
    ending: Ending
    evidence: Evidence | None = None
    errors: KeptErrors | None = None
    measured: tuple[datetime, datetime] | None = None

    @property
    def date(self) -> datetime | None:
        """The middle of the measurement; where that is not known, when the file was made."""
        if self.measured is None:
            return self.created
        first, last = self.measured
        return first + (last - first) / 2

    def of_dimensions(self, dimensions: Mapping[str, Dimension]) -> KnownParameters:
        """The same without covariance of parameters that are of another dimension here, and so no partners."""
        kept = [
            k for k, n in enumerate(self.names)
            if n not in dimensions or dimensions[n].fits(self.parameters[n].unit.dimension)
        ]  # fmt: skip
        covariance = None if self.covariance is None else self.covariance[np.ix_(kept, kept)]
        names = tuple(self.names[k] for k in kept)
        odd = set(self.names) - set(names)
        parameters = {n: p for n, p in self.parameters.items() if n not in odd}
        return replace(self, names=names, covariance=covariance, parameters=parameters)

    @property
    def exact(self) -> frozenset[str]:
        """Parameters without uncertainty: what the fit held exactly."""
        return frozenset(self.parameters) - frozenset(self.names)

    @property
    def values(self) -> dict[str, float]:
        """Values by name."""
        return {name: p.value for name, p in self.parameters.items()}


def known_parameters(path: str) -> KnownParameters:
    """Read a parameter file. Raises BadInput with all faults."""
    source = read_source(path, "a parameter file", "parameters:")
    tree, faults = SourceMap(source.root, {source.file: source.lines}), FaultList()
    for fault in source.faults:
        faults.add(fault)
    section = source.root.child("parameters")
    if section is None or not isinstance(section.value, dict):
        hint = "add a map `parameters:`; `pkmcal calibrate -o FILE` writes a parameter file"
        faults.add(tree.fault("parameters", "this file has no map `parameters`", (), hint))
        faults.raise_if_any()
    assert section is not None and isinstance(section.value, dict)
    entries, evidence = _entries(tree, section.value, faults), read_evidence(tree, faults)
    errors = read_errors(tree, faults)
    faults.raise_if_any()
    units = {name: p.unit.scale for name, p in entries.items()}
    names, covariance = _covariance(_plain(source.root, "correlations"), units)
    head = _plain(source.root, "provenance")
    head = head if isinstance(head, dict) else {}
    return KnownParameters(
        file=source.file,
        sha256=source.sha256,
        parameters=entries,
        names=names,
        covariance=covariance,
        data=read_data(_plain(source.root, DATA), units, _written(section.value)),
        fingerprint=_fingerprint(_plain(source.root, FINGERPRINT)),
        created=_date(head.get("created")),
        measured=_span(head),
        inputs={str(k): str(v) for k, v in _map(head.get("inputs")).items()},
        evidence=evidence,
        errors=errors,
        ending=read_ending(source.root),
    )


def _entries(tree: SourceMap, section: Mapping[str, SourceNode], faults: FaultList) -> dict[str, KnownParameter]:
    """Parameters by name; what cannot be read is added to `faults`."""
    entries: dict[str, KnownParameter] = {}
    for name, node in section.items():
        try:
            entries[name] = _entry(node)
        except UnitError as error:
            faults.add(tree.fault("unit", error.message, ("parameters", name), error.hint, at_key=True))
        except (TypeError, ValueError, OverflowError):
            message = f"`{name}` must have a finite `value`, and its `unit`"
            faults.add(tree.fault("value", message, ("parameters", name), _WRITE, at_key=True))
    return entries


def fitted_tables(known: KnownParameters, inputs: Mapping[str, str]) -> list[str]:
    """Tables, sha256 by name, whose rows a calibration was fitted to already."""
    fitted = set(known.inputs.values())
    return [name for name, digest in inputs.items() if digest in fitted]


def _plain(root: SourceNode, key: str) -> Any:
    node = root.child(key)
    return None if node is None else node.plain()


def _map(plain: object) -> Mapping[Any, Any]:
    return plain if isinstance(plain, dict) else {}


def _written(section: Mapping[str, SourceNode]) -> Values:
    """Numbers and units as they stand in the file."""
    entries = {name: _map(node.plain()) for name, node in section.items()}
    return {name: (entry.get("value"), str(entry.get("unit") or "1")) for name, entry in entries.items()}


def _entry(node: SourceNode) -> KnownParameter:
    """One entry. Raises UnitError, TypeError, ValueError, OverflowError."""
    plain = node.plain()
    entry = plain if isinstance(plain, dict) else {"value": plain}
    value, unit = entry.get("value"), parse_unit(str(entry.get("unit") or "1"))
    if isinstance(value, str):
        value, unit = parse_value(value)
    if isinstance(value, bool) or not isinstance(value, int | float):
        raise TypeError("no number")
    std = entry.get("std")
    spread = float(std) * unit.scale if isinstance(std, int | float) and not isinstance(std, bool) else math.nan
    number = unit.to_si(float(value))
    if not math.isfinite(number):
        raise ValueError("not finite")
    spread = spread if spread >= 0 else math.nan
    asked = math.isfinite(spread) or bool(entry.get("note"))
    return KnownParameter(number, spread, entry.get("identified") is True, unit, asked)


def _covariance(plain: Any, units: Mapping[str, float]) -> tuple[tuple[str, ...], Array | None]:
    """Names and covariance, SI, of the section `correlations`; None where it is not whole, or no covariance."""
    if not isinstance(plain, dict) or not {"names", "std", "matrix"} <= plain.keys():
        return (), None
    try:
        names = tuple(str(n) for n in plain["names"])
        std = np.array(plain["std"], dtype=float) * [units[n] for n in names]
        matrix = np.array(plain["matrix"], dtype=float)
    except (KeyError, TypeError, ValueError):
        return (), None
    p = len(names)
    if std.shape != (p,) or matrix.shape != (p, p) or not np.isfinite(matrix).all() or not (std > 0).all():
        return (), None
    matrix = 0.5 * (matrix + matrix.T)
    if p and np.linalg.eigvalsh(matrix)[0] < -_ROUNDING * p:
        return (), None
    return names, matrix * np.outer(std, std)


def _fingerprint(plain: Any) -> Fingerprint | None:
    try:
        return read_fingerprint(plain)
    except ValueError:
        return None


def _span(head: Mapping[Any, Any]) -> tuple[datetime, datetime] | None:
    """When the rows were measured, of a provenance."""
    first, last = (_date(head.get(key)) for key in ("measured_from", "measured_to"))
    return None if first is None or last is None else (first, last)


def _date(text: object) -> datetime | None:
    """A date, UTC where it says none else."""
    try:
        date = datetime.fromisoformat(str(text))
    except ValueError:
        return None
    return date if date.tzinfo is not None else date.replace(tzinfo=UTC)
