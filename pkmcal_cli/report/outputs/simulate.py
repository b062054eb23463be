"""What `simulate --json` writes."""

from __future__ import annotations

from pkmcal_cli.report.outputs.keys import Output

SIMULATE = Output(
    "simulate",
    """
verdict complete|incomplete: `incomplete`: rows of a table have no solution
tool_point text?: point whose poses a grid or table gives; null if the table gives actuator positions
n_rows integer: number of rows written
n_failed integer: number of rows without a solution, or points of a grid that are skipped; not written
failed[].file text?: such a row (at most 1000 are listed): file, or null for `--grid`
failed[].line integer: line in the file, or index of the grid point
failed[].id text?: the row's `id`, or null
failed[].reason text: why it has no solution
method exact|linear|rigid: `exact`, `linear` or `rigid`
substructure~[] text: `linear` and `rigid`: the actuators that give the rigid pose, those that are not redundant
noise text: as given
seed integer: as given
output text: file that contains the table
channels[].name text: a channel
channels[].unit text: its unit
channels[].min number?: smallest reading; null without rows
channels[].max number?: largest reading
loads.force_limit[].actuator text: an actuator with `force_limit`
loads.force_limit[].limit number?: N or N m
loads.force_limit[].n_rows integer: number of rows with a larger force
loads.force_limit[].largest number?: largest force of these rows
loads.force_limit[].row integer?: its `id` or line, or null
loads.t_min[].rope text: a rope with `t_min`
loads.t_min[].limit number?: N
loads.t_min[].n_rows integer: number of rows with less tension
loads.t_min[].least number: least tension of these rows
loads.t_min[].row integer: as above
loads.disagreement.n_rows integer: number of rows in which the actuators strain the structure by more than parameter
    ranges and noise explain, and more than 0.001 of the machine's size; 0 if all actuators have a `force_limit`
loads.disagreement.largest number?: largest disagreement, m
loads.disagreement.row text?: as above
loads.slack.n_rows integer: number of rows with slack ropes
loads.slack.ropes.ROPE integer: number of rows in which the rope is slack
provenance~.seed integer: as given
provenance.noise text: as given
provenance.method text: as given
uncertainty~.rms number?: with `--uncertainty`: standard uncertainty of the TCP position due to the calibration
    (in the axes of the instrument where only instruments with `frame: fitted` read positions), rms over all positions
uncertainty.max number?: largest value
uncertainty.at text: position of the largest value
uncertainty.unit text:
""",
)
