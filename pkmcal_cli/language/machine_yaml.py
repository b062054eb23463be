"""Reading a machine file: from YAML to a resolved `Machine`, or all faults at once."""

from __future__ import annotations

import os

from pkmcal_cli.base.errors import FaultList
from pkmcal_cli.language.checks.consistency import ConsistencyCheck
from pkmcal_cli.language.checks.references import NameCheck
from pkmcal_cli.language.checks.validation import validated
from pkmcal_cli.language.machine import Machine
from pkmcal_cli.language.overlay import load
from pkmcal_cli.language.resolve import Resolver


def read_machine(path: str | os.PathLike[str]) -> Machine:
    """The machine that a file describes, resolved (SI, every quantity bound).

    Raises `BadInput` (exit code 3) with all faults found, each with its place and a remedy.
    """
    faults = FaultList()
    loaded = load(os.fspath(path), faults)
    source = loaded.source
    as_written, quarantined = validated(source, faults)
    if as_written is None:
        faults.raise_if_any()
        raise AssertionError("a machine without faults")
    NameCheck(machine=as_written, source=source, faults=faults, quarantined=quarantined).run()
    ConsistencyCheck(as_written, source, faults, quarantined).run()
    machine = Resolver(machine=as_written, source=source, faults=faults, quarantined=quarantined).run()
    faults.raise_if_any()
    machine._source = source
    machine._files = loaded.files
    machine._warnings = tuple(faults.warnings)
    return machine
