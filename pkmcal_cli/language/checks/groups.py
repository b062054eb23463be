"""Groups of places: every member is there, and a name of a group is no name of a member."""

from __future__ import annotations

from pkmcal_cli.base.errors import FaultList, did_you_mean
from pkmcal_cli.language.machine import WrittenMachine
from pkmcal_cli.language.sections import sections_with
from pkmcal_cli.yaml_source.tree import Path, SourceMap

_RESERVED = ("all",)


def check_groups(machine: WrittenMachine, source: SourceMap, faults: FaultList, excused: frozenset[str]) -> None:
    """Add the faults of the section `groups`."""
    sections = ("actuators", "guides", "bodies", "sensors", *sections_with("between"), "ground", "frames")
    known = {name for section in sections for name in getattr(machine, section)} | excused
    for name, members in machine.groups.items():
        path: Path = ("groups", name)
        if name in _RESERVED or name in known:
            taken = "stands for all places" if name in _RESERVED else "is the name of a part of the machine"
            faults.add(source.fault("name", f"`{name}` {taken}", path, "choose another name", at_key=True))
        if len(set(members)) < 2:
            hint = "name two or more, for example `upper: [q1, q2]`"
            faults.add(source.fault("value", f"group `{name}` has fewer than two members", path, hint, at_key=True))
        for index, member in enumerate(members):
            if member not in known:
                message = f"`{member}` is no drive, guide, element, sensor or point of the base"
                hint = did_you_mean(member, sorted(known)) or "name a part that the machine has, or delete this member"
                faults.add(source.fault("unknown-name", message, (*path, index), hint))
