"""How large the errors of a fit were, as a parameter file keeps them: `compare --fail-above` holds limits against them.

Root mean squares by kind ("position", "orientation", kinds of sensors) of rows fitted and held out; chi-square.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field

from pkmcal_cli.base.errors import FaultList
from pkmcal_cli.loading.parameter_text import ERRORS, yaml_number
from pkmcal_cli.loading.written_sections import written_map, written_quantity, written_section
from pkmcal_cli.units.unit_text import Unit
from pkmcal_cli.yaml_source.tree import Path, SourceMap

_CHI2, _FITTED, _HELDOUT = "chi2_per_dof", "fitted", "heldout"
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
    section = written_section(tree, faults, ERRORS)
    if section is None:
        return None
    known = {n: e for n, e in section.items() if n == _CHI2}
    chi2 = written_quantity(tree, faults, known, (ERRORS, _CHI2), _CHI2, 0.0)[0] if known else math.nan
    fitted, heldout = (_kinds(tree, faults, section.get(name, {}), (ERRORS, name)) for name in (_FITTED, _HELDOUT))
    return KeptErrors(fitted, heldout, chi2)


def _kinds(tree: SourceMap, faults: FaultList, plain: object, path: Path) -> Rms:
    """Root mean squares by kind."""
    kinds = written_map(tree, faults, plain, path) or {}
    return {kind: written_quantity(tree, faults, entry, (*path, kind), "rms", 0.0) for kind, entry in kinds.items()}


def _digits(value: float) -> str:
    """Six of them: the errors are known to two."""
    return yaml_number(float(f"{value:.6g}"))
