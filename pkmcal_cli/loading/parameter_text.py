"""Parameter files as text: identified values, their uncertainty, of which machine and where from."""

from __future__ import annotations

import json
import math
import re
from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from pkmcal_cli.language.fingerprint import Fingerprint
from pkmcal_cli.loading.evidence import Evidence
from pkmcal_cli.units.unit_text import Unit

if TYPE_CHECKING:
    from collections.abc import Sequence

FINGERPRINT = "fingerprint"
ERRORS = "errors"
"""Sections of a parameter file."""

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
    evidence: Evidence | None = None,
    more: Sequence[str] = (),
) -> str:
    """The text of a parameter file; `fingerprint`: of the machine that the values belong to; more: further sections."""
    import yaml

    lines = [
        "# Parameters identified by pkmcal. Every command reads them with `-p FILE`.",
        f"# Without the line `{FINGERPRINT}`, they are accepted for every machine with parameters of these names.",
    ]
    head = yaml.safe_dump({"provenance": dict(provenance)}, sort_keys=False, allow_unicode=True, width=1000)
    lines += [head.rstrip(), f"{FINGERPRINT}: {fingerprint.line()}", "parameters:"]
    for e in entries:
        std = "null" if e.std is None else yaml_number(e.std)
        unit = f", unit: {scalar(e.unit)}" if e.unit not in ("", "1") else ""
        identified = "true" if e.identified else "false"
        note = f", note: {json.dumps(e.note, ensure_ascii=False)}" if e.note else ""
        entry = f"value: {yaml_number(e.value)}, std: {std}{unit}, identified: {identified}{note}"
        lines.append(f"  {scalar(e.name)}: {{{entry}}}")
    lines += [] if evidence is None else evidence.lines()
    if correlations is not None:
        lines += [
            "# For sums of parameters. The noise, and what each range allows, are as wide as they turned out to be,",
            "# each by itself, so that what cancels in sums still does: std may differ from those in `parameters`.",
            "correlations: # of all that is uncertain; std of what is held: half its range, as it turned out",
        ]
        lines.append(f"  names: [{', '.join(scalar(n) for n in correlations.names)}]")
        lines.append(f"  std: [{', '.join(yaml_number(v) for v in correlations.std)}]")
        lines.append("  matrix:")
        lines += [f"    - [{', '.join(_number(v) for v in row)}]" for row in correlations.matrix]
    lines += more
    return "\n".join(lines) + "\n"


_PLAIN = re.compile(r"[A-Za-z][A-Za-z0-9_/^*]*")
_WORDS = frozenset(["y", "n", "yes", "no", "true", "false", "on", "off", "null"])  # other readers convert these


def scalar(text: str) -> str:
    """A text as a YAML scalar, quoted where it could be taken for something else."""
    return text if _PLAIN.fullmatch(text) and text.lower() not in _WORDS else json.dumps(text, ensure_ascii=False)


def yaml_number(value: float) -> str:
    """A number that every YAML reader takes for one: 1.0e-06, not 1e-06."""
    text = repr(value)
    return text.replace("e", ".0e") if "e" in text and "." not in text else text


def _number(value: float) -> str:
    return "null" if math.isnan(value) else f"{value:.12g}"
