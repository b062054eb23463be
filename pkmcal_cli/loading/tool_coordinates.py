"""Which coordinates of the tool point can be asked for, and why others cannot."""

from __future__ import annotations

from collections.abc import Sequence

from pkmcal_cli.base.errors import BadInput, Location
from pkmcal_cli.base.plural import count
from pkmcal_cli.language.tool_point import REMEDY, ToolPoint, tool_point_of
from pkmcal_cli.loading.load_machine import LoadedMachine
from pkmcal_cli.model.tool_motion import ToolMotion

_SETS = 8  # sets of coordinates that are listed


def required_tool_point(loaded: LoadedMachine) -> ToolPoint:
    """The tool point. Raises BadInput where the machine has none."""
    tool = tool_point_of(loaded.machine)
    if tool is None:
        message = "the machine has no tool point: it has neither `tool_point` nor a sensor of kind `tcp`"
        raise BadInput.single(message, Location(loaded.model.name), REMEDY, "tool-point")
    return tool


def tool_motion(loaded: LoadedMachine) -> ToolMotion:
    """How the tool point moves, where its pose says where the mechanism is. Raises BadInput where it does not."""
    tool, motion = required_tool_point(loaded), loaded.model.tool_motion
    if motion.shown < motion.freedoms:
        freedoms = count(motion.freedoms, "degree")
        message = f"the pose of tool point `{tool.name}` shows {motion.shown} of the mechanism's {freedoms} of freedom"
        hint = "name another `tool_point`, or give a table of actuator positions instead of poses"
        raise BadInput.single(message, Location(loaded.model.name), hint, "tool-point")
    return motion


def unusable_set(loaded: LoadedMachine, names: Sequence[str]) -> tuple[str, str]:
    """Why some coordinates cannot be asked for together, and the sets that can."""
    motion, tool = loaded.model.tool_motion, required_tool_point(loaded).name
    sets = ["`" + ", ".join(s) + "`" for s in motion.sets if s]
    more = f" (and {len(sets) - _SETS} more sets)" if len(sets) > _SETS else ""
    part = "a part of it" if len(sets) == 1 else "a part of one of them"
    hint = f"use {' or '.join(sets[:_SETS])}{more}, or {part}" if sets else "leave out `--grid`"
    lacking = [n for n in names if n not in motion.names]
    still = [n for n in names if not motion.moves(n)]
    if lacking:
        return f"tool point `{tool}` is a node without rotation: it has no {_listed(lacking)}", hint
    if not motion.freedoms:
        return "the mechanism has no degree of freedom", hint
    if still:
        return f"no degree of freedom moves {_listed(still)} of tool point `{tool}`", hint
    if len(names) > motion.freedoms:
        freedom = count(motion.freedoms, "degree") + " of freedom"
        return f"{count(len(names), 'coordinate')} ({', '.join(names)}), but the mechanism has {freedom}", hint
    return f"{_listed(names)} of tool point `{tool}` do not move independently of each other", hint


def kept_note(names: Sequence[str]) -> str:
    """What is said of coordinates that were not asked for."""
    return f"{_listed(names)} kept as in the reference configuration"


def _listed(names: Sequence[str]) -> str:
    return ", ".join(f"`{n}`" for n in names)
