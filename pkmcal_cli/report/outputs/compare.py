"""What `compare --json` writes."""

from __future__ import annotations

from pkmcal_cli.report.outputs.keys import Output

COMPARE = Output(
    "compare",
    """
kind parameters|machines|history: `parameters`; `machines` and `history`: see below
verdict no change|changed|nothing in common|one is better|no difference|too few rows|intact|changed since: `no change`
    or `changed`, by the test of all; `nothing in common`: there is none; of machine files `one is better`, `no
    difference`, or `too few rows`, where both predict less than half of them; of runs `intact` or `changed since`
named~[] text: what has changed: parameters by their own tests (if one change explains everything, only those that
    do so alone); else those of which one alone explains the change
files~[].file text: what is compared
files[].created text?: date, or null
files[].measured_from text?: date of the first row, null where its table had no dates
files[].measured_to text?: of the last row
files[].status text: how the fit ended
test~.statistic number?: F: chi-square over its degrees of freedom, noise as it turned out to be; null without any
test.degrees_of_freedom integer: combinations of parameters that all determine
test.noise_degrees_of_freedom number?: by which noise is known
test.p_value number?:
test.alpha number: as given
alone~?.name text: the one parameter that alone explains most; `alone` is null if none does
alone.change number: in `unit`
alone.std number?:
alone.unit text:
alone.p_value_left number?: of what it leaves; null if nothing can be left
alone.explains flag: whether something has changed and this explains it (`p_value_left` at least 0.01)
alone.rivals[].name text: another that alone explains it nearly as well (chi-square within 3.84)
alone.rivals[].change number: in `unit`
alone.rivals[].std number?:
alone.rivals[].unit text:
alone.rivals[].p_value_left number?: of what it leaves
per~ text?: `day` where `change` of parameters is per day: a trend of three files or more of dates at least a day
    apart; else null
since~ text?: first file after a step, where a step of one parameter explains three files or more better than a trend;
    else null
parameters~[].name text: a parameter that all fits identified
parameters[].values[] number: its value in each file, in `unit`
parameters[].change number: change from the first file to the last, per day, or by a step
parameters[].std number?: its standard uncertainty
parameters[].unit text:
parameters[].determined flag: whether all data sets determine its whole change (to half its range)
parameters[].p_value number?: of no change; null if not determined
parameters[].p_value_holm number?: corrected by Holm
parameters[].changed flag: whether it is among `named`
effects~[].name text: a number of an effect
effects[].values?[] number?: its value in each file, in `unit`; null where it lacks
effects[].stds[] number?:
effects[].unit text:
effects[].p_value number?: of the same size in the first and last file that have it; null where that is not known
effects[].remark text?: `only in ...`, `other size`, or null
tool_point~?.rms number?: change of the predicted position (of the orientation, where it only turns) over the
    workspace, from the first file to the last or by a step; `tool_point` is null where it cannot be told
tool_point.rms_by_chance number: the same if nothing has changed
tool_point.max number?: largest change
tool_point.std number?: its standard uncertainty
tool_point.unit text:
tool_point.at.AXIS number: where it is largest, in `at_unit`
tool_point.at_unit text:
tool_point.count integer: number of poses
tool_point.over text: `workspace`, or `measured travel`
tool_point.alone text?: the parameter by whose change alone it is computed, where that explains everything; else null
apart~[].name text: a parameter that is not compared
apart[].files[] text: files that have it
gates~[].gate text: a limit of `--fail-above`, as written
gates[].what text: what it is held against
gates[].value number?: in `unit`; 0 where the test sees no change; null where it is not known (the limit is then
    missed)
gates[].limit number?:
gates[].unit text:
gates[].kept flag: whether the value is not above the limit
---
machines~[] text: both machine files
better~ text?: the one that predicts held-out rows better; null if the rows do not tell
of~ text: kind of readings, such as `position`
rms~[] number?: held-out error of both, in `unit`
change~.value number?: difference of these
change.low number?: its 95 % interval
change.high number?:
unit~ text:
count~ integer: number of rows in pairs
rows~ integer: number of rows in the table
scheme~ text: how rows were held out
---
runs~[].folder text:
runs[].command text:
runs[].machine text: machine file
runs[].created text: date
runs[].verdict text: in words
runs[].rms text?: in words; null if the command has none
runs[].exit_code integer:
runs[].intact flag: whether the results are as they were written
""",
)
