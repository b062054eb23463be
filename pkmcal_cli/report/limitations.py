"""What cannot be done with a machine as its file has it, and why."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

from pkmcal_cli.base.plural import count
from pkmcal_cli.language.machine import Machine
from pkmcal_cli.language.tool_point import tool_point_of
from pkmcal_cli.model.model import Model

_FITTING = ("observability", "calibrate", "diagnose", "improve", "plan")
_POSING = ("grids", "tables of poses")


def limitations(machine: Machine, model: Model) -> list[dict[str, Any]]:
    """What the machine lacks, what that rules out (commands, poses of the tool point), and what is to be done."""
    lacks: list[tuple[str, tuple[str, ...], str]] = []
    if not model.channels:
        lacks.append(("sensors", _FITTING, "declare a sensor"))
    elif not any(math.isfinite(c.sigma) for c in model.channels):
        lacks.append(("a `sigma`", _FITTING, "state the `sigma` of a sensor or encoder"))
    if not model.parameters:
        lacks.append(("parameters", ("sensitivity", *_FITTING), "declare `parameters`"))
    if tool_point_of(machine) is None:
        lacks.append(("a tool point", ("sensitivity", *_POSING, "simulate --uncertainty"), "add `tool_point: NAME`"))
    if all(d.force_controlled for d in model.topology.drives):
        kind = "actuators" if not model.topology.drives else "actuators that hold a position"
        lacks.append((kind, _POSING, "`simulate` shows the machine as it stands, under its loads"))
    return [{"lacking": lacking, "rules_out": list(out), "remedy": remedy} for lacking, out, remedy in lacks]


def outside_text(rows: Mapping[str, int]) -> list[str]:
    """Warnings of rows outside the knots of shapes without a name, by the name of these."""
    consequence = "the shape is not known there: it falls back to its level, as uncertain as its spread"
    return [f"warning: {name}: {count(n, 'row')} outside its knots; {consequence}" for name, n in rows.items() if n]
