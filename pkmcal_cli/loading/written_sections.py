"""Sections that a calibration wrote into a parameter file, read with all their faults."""

from __future__ import annotations

import math

from pkmcal_cli.base.errors import FaultList
from pkmcal_cli.units.dimensions import Dimension
from pkmcal_cli.units.unit_text import UNITS, Unit, UnitError, parse_unit
from pkmcal_cli.yaml_source.tree import Path, SourceMap

_AS_WRITTEN = "leave this section as `pkmcal calibrate -o` wrote it"


def written_section(tree: SourceMap, faults: FaultList, name: str) -> dict[str, object] | None:
    """Entries of a section by name; None without it."""
    node = tree.root.child(name)
    return None if node is None else written_map(tree, faults, node.plain(), (name,))


def written_map(tree: SourceMap, faults: FaultList, plain: object, path: Path) -> dict[str, object] | None:
    """Entries of a map by name; None for what is none, a fault."""
    if not isinstance(plain, dict):
        faults.add(tree.fault("value", f"`{path[-1]}` must be a map", path, _AS_WRITTEN, at_key=True))
        return None
    return {str(k): v for k, v in plain.items()}


def written_quantity(
    tree: SourceMap,
    faults: FaultList,
    entry: object,
    path: Path,
    key: str,
    least: float = -math.inf,
    of: Dimension | None = None,
) -> tuple[float, Unit]:
    """A number of an entry, SI, and its unit; 0 where it, or its unit, is a fault."""
    value, text = (entry.get(key), str(entry.get("unit", "1"))) if isinstance(entry, dict) else (None, "1")
    try:
        unit = parse_unit(text)
        if of is not None and unit.dimension != of:
            raise UnitError(f"the unit of `{path[-1]}` must be one of {of}", _AS_WRITTEN)
    except UnitError as error:
        faults.add(tree.fault("unit", error.message, path, error.hint, at_key=True))
        return 0.0, UNITS["1"]
    if isinstance(value, bool) or not isinstance(value, int | float) or not least <= value < math.inf:
        holder = "" if path[-1] == key else f" of `{path[-1]}`"
        message = f"`{key}`{holder} must be a finite number" + (", not below 0" if least == 0 else "")
        faults.add(tree.fault("value", message, path, _AS_WRITTEN, at_key=True))
        return 0.0, unit
    return float(unit.to_si(float(value))), unit
