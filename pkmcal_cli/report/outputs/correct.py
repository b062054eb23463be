"""What `correct --json` writes."""

from __future__ import annotations

from pkmcal_cli.report.outputs.keys import Output

CORRECT = Output(
    "correct",
    """
verdict complete|incomplete: `incomplete`: targets of a table have no set values
tool_point text: point whose coordinates the targets are
coordinates[] text: coordinates that were given
held[] text: coordinates that are corrected; those that were not given keep their values of the reference
    configuration
redundant text: `min-force`, `min-energy`, `preload` or `nominal`
n_targets integer: number of targets
n_corrected integer: number of targets with commands, the rows of the table
n_failed integer: number of targets without commands
failed[].file text?: such a target (at most 1000 are listed): file, or null for `--grid`
failed[].line integer: line in the file, or index of the grid point
failed[].id text?: its `id`, or null
failed[].reason text: why it has none: out of reach, or which limits are in the way
errors.KIND.before.rms number?: predicted error of the tool point at the set values of the nominal machine; `KIND`:
    `position`, `orientation`
errors.KIND.before.max number?:
errors.KIND.after.rms number?: the same at the commands; 0 where it is rounding
errors.KIND.after.max number?:
errors.KIND.u_before.rms number?: standard uncertainty of the error before, all coordinates together; null without
    `correlations` in the parameter file
errors.KIND.u_before.max number?:
errors.KIND.u.rms number?: the same after
errors.KIND.u.max number?:
errors.KIND.u_apart~.rms number?: of positions: standard uncertainty to each other at the commands, but for a shift
    and a turn that all targets have in common; null with too few targets, or where not all coordinates are held
errors.KIND.u_apart.max number?:
errors.KIND.unit text:
not_held.COORDINATE.rms number: coordinates of the tool point that set values do not hold and that are off: by how
    much at the commands, against the nominal machine
not_held.COORDINATE.max number:
not_held.COORDINATE.unit text:
drives[].name text: an actuator
drives[].before number?: its largest force at the set values of the nominal machine
drives[].after number?: at the commands
drives[].load number: part that carries the load, the least sum of squares in units of `force_limit`
drives[].internal number: part by which the drives only act against each other
drives[].u number?: largest standard uncertainty of its force; null without `correlations`
drives[].limit number?: `force_limit`; null without one
drives[].unit text:
ropes[].name text: a rope; of ropes that are one cable, the cable
ropes[].before number?: its least tension at the set values of the nominal machine, N
ropes[].after number?: at the commands
ropes[].t_min number?: what is stated; null without one
ropes[].hardly_taut integer: number of targets at which it is slack or its tension is below 2 % of the largest; 0 with
    `t_min` and where no drive is redundant
hardly_taut integer: number of targets with such ropes
strain_energy.before number?: mean over the targets, J
strain_energy.after number?:
weak integer: number of targets most of whose variance comes from directions that the calibration hardly determines
outside.COLUMN integer: number of targets outside the range in which the calibration measured, by actuator or
    circumstance
outside_values.COLUMN.value number: the value of these targets that is farthest outside, as it was understood
outside_values.COLUMN.low number: end of the measured range
outside_values.COLUMN.high number:
outside_values.COLUMN.unit text:
outside_values.COLUMN.far flag: whether a circumstance is ten measured spans or more outside: look at its unit
without_effect[] text: circumstances of the targets on which no effect of the machine file depends
sides_not_settled integer: number of targets that their own commands approach from another side than assumed
unexplained.KIND.std number?: what the calibration left beyond noise, of one coordinate; it is part of the
    uncertainties
unexplained.KIND.unit text:
times_noise number?: how many times larger than the stated noise the residuals of the calibration are, 1 if they
    agree; null if the parameter file does not say
loads.force_limit[].actuator text: as in `simulate`
loads.force_limit[].limit number?:
loads.force_limit[].n_rows integer:
loads.force_limit[].largest number?:
loads.force_limit[].row integer:
loads.t_min[].rope text:
loads.t_min[].limit number?:
loads.t_min[].n_rows integer:
loads.t_min[].least number:
loads.t_min[].row integer?:
loads.disagreement.n_rows integer:
loads.disagreement.largest number?:
loads.disagreement.row text?:
loads.slack.n_rows integer:
loads.slack.ropes.ROPE integer:
output text: file that contains the table
at text?: as given
provenance~.redundant text: as given
provenance.at text?: as given
export~.format text: only with `--as`: the format
export.title text: what it is
export.specification[] text: where its specification is public
export.files[] text: files that were written
export.n_targets integer: number of targets that count: those with corrected set values, and set values of the nominal
    machine
export.n_lost integer: number of these at which the machine finds no pose with the export installed
export.remaining.KIND.before.rms number?: predicted error of the tool point at the set values of the nominal machine
export.remaining.KIND.before.max number?:
export.remaining.KIND.export.rms number?: the same at the set values that the control sends with the export installed
export.remaining.KIND.export.max number?:
export.remaining.KIND.not_fitted~.rms number?: with tables: the same as `export` at targets that they were not fitted
    to, a fifth of all in turn; absent with fewer than 10 targets
export.remaining.KIND.not_fitted.max number?:
export.remaining.KIND.corrected.rms number?: the same at the corrected set values
export.remaining.KIND.corrected.max number?:
export.remaining.KIND.u number?: standard uncertainty of the corrected tool point, rms; null without `correlations` in
    the parameter file
export.remaining.KIND.unit text:
export.strain_energy.before number?: mean strain energy, J, of the same three
export.strain_energy.export number:
export.strain_energy.corrected number:
export.loads.force_limit[].actuator text: as `loads`, with the export; 1 % beyond a limit is allowed
export.loads.force_limit[].limit number?:
export.loads.force_limit[].n_rows integer:
export.loads.force_limit[].largest number?:
export.loads.force_limit[].row text?: target with the largest
export.loads.t_min[].rope text:
export.loads.t_min[].limit number?:
export.loads.t_min[].n_rows integer:
export.loads.t_min[].least number:
export.loads.t_min[].row text?:
export.loads.disagreement.n_rows integer:
export.loads.disagreement.largest number?:
export.loads.disagreement.row text?:
export.loads.slack.n_rows integer:
export.loads.slack.ropes.ROPE integer:
export.notes[] text: what the export holds for
export.entries[].parameter text: `--as adjust`: an adjustable parameter
export.entries[].what text: what is adjusted
export.entries[].change number: nominal less identified value
export.entries[].std number?: standard uncertainty of the identified value; null without `correlations`
export.entries[].unit text:
""",
)
