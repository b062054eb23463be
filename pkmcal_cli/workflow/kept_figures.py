"""What limits of `compare` are held against: what the last parameter file keeps of its fit."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence

from pkmcal_cli.base.errors import UsageError, did_you_mean
from pkmcal_cli.loading.kept_errors import KeptErrors, Rms
from pkmcal_cli.loading.known_parameters import KnownParameters
from pkmcal_cli.units.unit_text import parse_unit
from pkmcal_cli.workflow.gates import Figure, Figures, Gate, checked_error, checked_parameter

_OLD = "its file does not say; write it again with `pkmcal calibrate -o`"


def check_kept(limits: Iterable[Gate], known: KnownParameters) -> None:
    """Whether a file can have what limits name: its parameters and errors. Raises UsageError."""
    errors = known.errors or KeptErrors()
    kinds = {kind: unit.dimension for kind, (_, unit) in (*errors.fitted.items(), *errors.heldout.items())}
    for gate in limits:
        name = gate.figure.partition(":")[2]
        if name and name not in known.parameters:
            hint = did_you_mean(name, known.parameters, "its section `parameters` lists all")
            raise UsageError(f"{gate.option}: {known.file} has no parameter `{name}`", hint=hint)
        if name:
            checked_parameter(gate, name, known.parameters[name].unit)
        if gate.figure in ("heldout", "fitted") and kinds:
            checked_error(gate, kinds)


def kept_figures(known: KnownParameters) -> Figures:
    """By what limits name."""
    errors = known.errors
    figures: dict[str, Sequence[Figure] | str] = {"heldout": _OLD, "fitted": _OLD, "chi2": _OLD}
    if errors is not None:
        figures["heldout"] = _rms(errors.heldout, "held-out rows") or "nothing was held out"
        figures["fitted"] = _rms(errors.fitted, "fitted rows") or _OLD
        if math.isfinite(errors.chi2_per_dof):
            figures["chi2"] = [Figure("chi-square per degree of freedom", errors.chi2_per_dof, parse_unit("1"))]
    for name, p in known.parameters.items():
        std = p.std if math.isfinite(p.std) else math.inf
        figures[f"std:{name}"] = [Figure(f"standard uncertainty of {name}", std, p.unit.difference)]
    return figures


def _rms(kinds: Rms, rows: str) -> list[Figure]:
    return [Figure(f"{kind} rms of {rows}", rms, unit, kind) for kind, (rms, unit) in kinds.items()]
