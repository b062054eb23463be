"""Names that a machine file declares, for those who type them: read quickly, without a machine made of it."""

from __future__ import annotations

import os
from collections.abc import Mapping
from typing import Any

from pkmcal_cli.base.errors import FaultList, PkmcalError
from pkmcal_cli.base.shipped import machine_file
from pkmcal_cli.language.each import Expansion
from pkmcal_cli.yaml_source.read import read_source

_LARGE = 1 << 20  # bytes: a larger file is not read while somebody types
_DEEP = 8  # files that extend each other


def names_in(machine: str, section: str) -> list[str]:
    """Names in a section (`parameters`, `actuators`, `sensors`) of a machine file, as it is at the end of `extends`.

    Of a shipped machine too, called by its name. Nothing where the file cannot be read: nobody waits for a message.
    """
    try:
        return list(_section(machine_file(machine), section, _DEEP))
    except (PkmcalError, OSError, ValueError, RecursionError):
        return []


def _section(machine: str, section: str, deep: int) -> dict[str, Any]:
    if not os.path.isfile(machine) or os.path.getsize(machine) > _LARGE:
        return {}
    source = read_source(machine)
    root = Expansion(source.lines, FaultList()).run(source.root).plain()
    tree = root if isinstance(root, Mapping) else {}
    base = tree.get("extends")
    listed = tree.get(section)
    known: dict[str, Any] = {}
    if isinstance(base, str) and deep:
        known = _section(os.path.join(os.path.dirname(machine), base), section, deep - 1)
    if isinstance(listed, Mapping):
        known |= {str(name): entry for name, entry in listed.items()}
        known = {name: entry for name, entry in known.items() if entry is not None or name not in listed}
    return known
