"""Sense of a workspace: something is limited, in directions that the space has."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from pkmcal_cli.language.fields import PLANAR
from pkmcal_cli.language.machine import WrittenMachine
from pkmcal_cli.yaml_source.tree import Path

_EXAMPLE = "write, for example, `workspace: {box: {x: [-100 mm, 100 mm]}}`"


def check_workspace(machine: WrittenMachine, fault: Callable[..., Any]) -> None:
    """Checks the workspace of a machine as written; `fault(what, path, hint, at_key=...)` takes each fault."""
    workspace, path = machine.workspace, ("workspace",)
    if workspace is None:
        return
    box, cylinder = workspace.box, workspace.cylinder
    if box is None and cylinder is None and not workspace.drives:
        fault("the workspace limits nothing", path, _EXAMPLE, at_key=True)
    if box is not None:
        limited = [name for name, limits in box.__dict__.items() if limits is not None]
        if not limited:
            fault("`box` limits no coordinate", (*path, "box"), _EXAMPLE, at_key=True)
        for name in limited:
            if machine.space == "planar" and name not in PLANAR:
                where: Path = (*path, "box", name)
                fault(f"`{name}` does not exist in a planar machine", where, "use `x`, `y` or `rz`", at_key=True)
    if cylinder is not None and machine.space == "planar":
        for key in ("axis", "height"):
            if key in cylinder.model_fields_set:
                message = f"`{key}` does not exist in a planar machine: the cylinder is a circle"
                fault(message, (*path, "cylinder", key), "delete it", at_key=True)
