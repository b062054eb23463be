"""Reading a machine file: from YAML to a resolved `Machine`, or all faults at once."""

from __future__ import annotations

import os

from pkmcal_cli.base.errors import FaultList
from pkmcal_cli.language.checks.consistency import SenseCheck
from pkmcal_cli.language.checks.references import NameCheck
from pkmcal_cli.language.checks.validation import shape
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
    drafted, aside = shape(source, faults)
    if drafted is None:
        faults.raise_if_any()
        raise AssertionError("a machine without faults")
    NameCheck(machine=drafted, source=source, faults=faults, aside=aside).run()
    SenseCheck(drafted, source, faults, aside).run()
    machine = Resolver(machine=drafted, source=source, faults=faults, aside=aside).run()
    faults.raise_if_any()
    machine._source = source
    machine._files = loaded.files
    machine._warnings = tuple(faults.warnings)
    return machine
