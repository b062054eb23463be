"""What `draw --json` writes."""

from __future__ import annotations

from pkmcal_cli.report.outputs.keys import Output

DRAW = Output(
    "draw",
    """
verdict complete: `complete`
row text: the row that is drawn: file and line, point of the grid, or the reference configuration
scale number: factor by which displacements are drawn larger
tool_point text?: point that poses, grids, sensitivities and error maps mean; null without one
places[].name text: a node, a body, a point of a body or of the base
places[].believed[] number: where the control believes it to be: x, y, z, m
places[].displacement[] number: displacement along x, y, z, um
drives[].name text: a drive
drives[].reading number?: its set value or reading, m or rad; null where nothing is known of it
drives[].force number?: its force, N, or moment, N m
drives[].turns flag: whether it turns: then `force` is a moment
members[].name text: a bar, beam, rope or other member
members[].tension number?: its axial force, N, positive where it pulls
""",
)
