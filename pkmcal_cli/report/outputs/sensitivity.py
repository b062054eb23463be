"""What `sensitivity --json` writes."""

from __future__ import annotations

from pkmcal_cli.report.outputs.keys import Output

SENSITIVITY = Output(
    "sensitivity",
    """
verdict complete: `complete`
tool_point text: point whose displacement it is
n_failed integer: number of points of a grid that are skipped
failed[].file text?: such a point (at most 1000 are listed): null
failed[].line integer: index of the point
failed[].id text?: null
failed[].reason text: why it is skipped
n_rows integer: number of positions
parameters[].name text: a parameter
parameters[].position number?: mean displacement of the TCP in `unit`
parameters[].orientation number?: mean rotation of the TCP, rad; 0 if the TCP has no orientation
parameters[].unit text: of `position`
parameters[].orientation_unit text: `rad`
parameters[].range number: the parameter's range in `range_unit`
parameters[].range_unit text: unit of range and size
parameters[].size number?: the size for which the displacement is: that of `--size`, else the range
channel text?: coordinate of `--channel`, or null
parameters[].mean number?: mean displacement of this coordinate in `channel_unit`; null without `--channel`
parameters[].largest number?: the largest one, with its sign
parameters[].channel_unit text?:
""",
)
