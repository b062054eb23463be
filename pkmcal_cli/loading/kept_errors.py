"""How large the errors of a fit were, as a parameter file keeps them: `compare --fail-above` holds limits against them.

Root mean squares by kind ("position", "orientation", kinds of sensors) of rows fitted and held out; chi-square.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field

from pkmcal_cli.base.errors import FaultList
from pkmcal_cli.loading.parameter_text import yaml_number
from pkmcal_cli.units.unit_text import Unit, UnitError, parse_unit
from pkmcal_cli.yaml_source.tree import Path, SourceMap

ERRORS = "errors"
"""Section of a parameter file."""

_CHI2, _FITTED, _HELDOUT = "chi2_per_dof", "fitted", "heldout"
_AS_WRITTEN = "leave this section as `pkmcal calibrate -o` wrote it"

Rms = Mapping[str, tuple[float, Unit]]
"""Root mean squares, SI, by kind of error, and the units in which they are shown."""


@dataclass(frozen=True)
class KeptErrors:
    """Errors of fitted rows and of rows held out, none where none were; chi-square per degree of freedom, or nan."""

    fitted: Rms = field(default_factory=dict)
    heldout: Rms = field(default_factory=dict)
    chi2_per_dof: float = math.nan

    def lines(self) -> list[str]:
        """As a section of a parameter file."""
        out = [f"{ERRORS}: # root mean squares of measured minus predicted"]
        if math.isfinite(self.chi2_per_dof):
            out.append(f"  {_CHI2}: {_digits(self.chi2_per_dof)}")
        for name, kinds in ((_FITTED, self.fitted), (_HELDOUT, self.heldout)):
            every = (f"{k}: {{rms: {_digits(u.from_si(v))}, unit: {u.definition}}}" for k, (v, u) in kinds.items())
            out += [f"  {name}: {{{', '.join(every)}}}"] if kinds else []
        return out if len(out) > 1 else []


def read_errors(tree: SourceMap, faults: FaultList) -> KeptErrors | None:
    """The errors of a parameter file; None where it says nothing. What cannot be read is added to `faults`."""
    node = tree.root.child(ERRORS)
    if node is None:
        return None
    plain = node.plain()
    if not isinstance(plain, dict):
        faults.add(tree.fault("value", f"`{ERRORS}` must be a map", (ERRORS,), _AS_WRITTEN, at_key=True))
        return None
    chi2 = _positive(tree, faults, plain[_CHI2], (ERRORS, _CHI2)) if _CHI2 in plain else math.nan
    fitted, heldout = (_kinds(tree, faults, plain.get(name, {}), (ERRORS, name)) for name in (_FITTED, _HELDOUT))
    return KeptErrors(fitted, heldout, chi2)


def _kinds(tree: SourceMap, faults: FaultList, plain: object, path: Path) -> Rms:
    """Root mean squares by kind."""
    if not isinstance(plain, dict):
        faults.add(tree.fault("value", f"`{path[-1]}` must be a map", path, _AS_WRITTEN, at_key=True))
        return {}
    out = {}
    for kind, entry in plain.items():
        here = (*path, str(kind))
        rms, text = (entry.get("rms"), str(entry.get("unit", "1"))) if isinstance(entry, dict) else (None, "1")
        try:
            unit = parse_unit(text)
        except UnitError as error:
            faults.add(tree.fault("unit", error.message, here, error.hint, at_key=True))
        else:
            out[str(kind)] = unit.to_si(_positive(tree, faults, rms, here)), unit
    return out


def _positive(tree: SourceMap, faults: FaultList, value: object, path: Path) -> float:
    """A number that is not below 0; 0 where it is a fault."""
    if isinstance(value, bool) or not isinstance(value, int | float) or not 0.0 <= value < math.inf:
        message = f"`{path[-1]}` must be a finite number, not below 0"
        faults.add(tree.fault("value", message, path, _AS_WRITTEN, at_key=True))
        return 0.0
    return float(value)


def _digits(value: float) -> str:
    """Six of them: the errors are known to two."""
    return yaml_number(float(f"{value:.6g}"))
