"""Where points are drawn: a box of the tool point's coordinates, "x=0:950,y=160:390", or the machine's workspace."""

from __future__ import annotations

import numpy as np

from pkmcal_cli.base.errors import UsageError
from pkmcal_cli.base.listener import Listener
from pkmcal_cli.calibration.study import Region
from pkmcal_cli.loading.grid import parse_grid
from pkmcal_cli.loading.load_machine import LoadedMachine
from pkmcal_cli.loading.tool_coordinates import tool_motion
from pkmcal_cli.loading.workspace_poses import usable_workspace, workspace_points, workspace_remedy
from pkmcal_cli.model.tool_motion import DIRECTIONS

_OPTION = "--within"
_AROUND = 200  # points between limits of drives, whose box is taken


def region_of(loaded: LoadedMachine, text: str | None, to: Listener) -> Region:
    """The box that `--within` states, or the one around the workspace. Raises UsageError and BadInput."""
    return _of_workspace(loaded, to) if text is None else _of_box(loaded, text)


def _of_box(loaded: LoadedMachine, text: str) -> Region:
    """A box of coordinates that move independently; the others are as in the reference configuration."""
    for part in text.split(","):
        if part.count("=") != 1 or part.count(":") != 1:
            message = f"{_OPTION}: `{part.strip()}` is not a side of a box"
            raise UsageError(message, hint='write NAME=LOWEST:HIGHEST, e.g. "x=0:950,y=160:390"')
    axes = parse_grid(loaded, ",".join(f"{part}:2" for part in text.split(",")), _OPTION).axes
    for axis in axes:
        if axis.start >= axis.stop:
            raise UsageError(f"{_OPTION}: `{axis.name}` has no room", hint="give the lower limit first")
    low, high = np.array([(a.start, a.stop) for a in axes]).T
    return Region(names=tuple(a.name for a in axes), low=low, high=high)


def _of_workspace(loaded: LoadedMachine, to: Listener) -> Region:
    """The box around the workspace, in as many coordinates as move independently. Raises UsageError without one."""
    space, motion = usable_workspace(loaded), tool_motion(loaded)
    if space is None:
        message = f"{loaded.model.name} has no workspace to draw points from"
        hint = f'{workspace_remedy(loaded)}, or give a box: `{_OPTION} "x=0:950,y=160:390"`'
        raise UsageError(message, hint=hint)
    low, high = space.bounds
    limited = [c for c, one, other in zip(DIRECTIONS, low, high, strict=True) if np.isfinite([one, other]).all()]
    names = tuple(c for c in motion.most_of([c for c in limited if c in motion.names]) if c in limited)
    if not names:  # it limits drives alone
        points = workspace_points(loaded, space, _AROUND, to)
        to.notes(points.notes)
        names, low, high = points.held, points.poses.min(axis=0), points.poses.max(axis=0)
    places = [DIRECTIONS.index(c) for c in names]
    return Region(names=names, low=low[places], high=high[places])
