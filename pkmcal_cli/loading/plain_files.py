"""YAML files that are no machine: what a file is by its keys, and records as plain data."""

from __future__ import annotations

from typing import Any

from pkmcal_cli.base.errors import BadInput, Location
from pkmcal_cli.yaml_source.read import read_source

_MACHINE = ("space", "extends", "actuators", "guides", "sensors")
_PARAMETERS = ("correlations", "provenance", "fingerprint", "parameters")


def yaml_kind(name: str) -> str:
    """Whether a file is a "machine" or holds "parameters", by its keys. Raises BadInput where it is neither."""
    root = read_source(name, "a parameter file or machine file", "parameters:").root
    keys = root.value.keys() if isinstance(root.value, dict) else ()
    if any(k in keys for k in _MACHINE):
        return "machine"
    if any(k in keys for k in _PARAMETERS):
        return "parameters"
    message = "this is neither a parameter file nor a machine file"
    raise BadInput.single(message, Location(name), "give files that `pkmcal calibrate -o` has written", "file")


def plain_map(name: str, kind: str, example: str) -> dict[str, Any]:
    """A file that is a map, as plain data. Raises BadInput."""
    source = read_source(name, kind, example)
    if source.faults:
        raise BadInput(list(source.faults))
    plain = source.root.plain()
    return plain if isinstance(plain, dict) else {}
