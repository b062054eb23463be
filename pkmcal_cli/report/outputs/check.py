"""What `check --json` writes."""

from __future__ import annotations

from pkmcal_cli.report.outputs.keys import Output

CHECK = Output(
    "check",
    """
verdict faults|no_faults|compatible|not_compatible|pass|fail|undecided: `faults` or `no_faults`; with `-p`
    `compatible` or `not_compatible`; with `--tolerance` `pass`, `fail` or `undecided`
ok flag: whether there are no faults
n_faults integer: number of faults
faults[].code text: kind of fault, as in the text `error[code]`; at most 50 faults are listed
faults[].message text: what is wrong
faults[].file text?: file, or null
faults[].line integer?: line, from 1, or null
faults[].column integer?: column, from 1, or null
faults[].help text?: how to correct it, or null
warnings~[].code text: a warning: same keys as a fault; not counted in `n_faults`
warnings[].message text:
warnings[].file text:
warnings[].line integer:
warnings[].column integer:
warnings[].help text?:
machine~ text: name of the file
space~ planar|spatial: `planar` or `spatial`
nodes~ integer: number of free points
bodies~ integer: number of carriages, platforms and other bodies
elements~.beams integer: number of beams
elements.bars integer: number of bars
elements.ropes integer: number of ropes
elements.joints integer: number of joints
unknowns~ integer: unknown coordinates of the equilibrium
constraints~ integer: constraints of the equilibrium
degrees_of_freedom~ integer: of the mechanism with all drives released, by rank
actuators~ integer: number of commanded drives
passive~ integer: number of drives that are only read
degree_of_redundancy~ integer: number of drives beyond the degrees of freedom
self_stress~ integer: number of states of self-stress that no drive causes
free_motions~[] text: motions that carry no load and are held fixed, in words
gaps~[].element text: gaps of the assembled reference configuration, largest first, at most 10: the element
gaps[].strain text: the nonzero strain
gaps[].value number?: its value, m or rad
channels~[] text: names of the measured channels
tool_point~ text?: point that poses, grids, sensitivities and error maps mean; null without one
workspace~[].name text: what the workspace limits: a coordinate of the tool point, or an actuator
workspace[].low number?: lower limit in `unit`, of box and cylinder together; null without one
workspace[].high number?: upper limit
workspace[].unit text:
limitations~[].lacking text: what the machine lacks, e.g. sensors
limitations[].rules_out[] text: commands, and kinds of poses, that are not possible without it
limitations[].remedy text: what lifts it
parameters~[].name text: a parameter
parameters[].nominal number: nominal value in `unit`
parameters[].range number: half-width about nominal, two standard deviations of the prior
parameters[].unit text: `1` for a plain number
parameters[].identify flag: whether `--select auto` selects it
parameters[].fixed flag: whether its value is exact
measurements~.n_rows integer?: number of rows in all tables; null if they cannot be read
measurements.n_values~ integer: number of measured values with a sigma
measurements.sessions~[] text: names of the sessions: the files, or the values in column `session`
measurements.nominal~[].name text: measured less predicted before any fit, at nominal parameters (with `-p` at its
    values; of at most 200 rows): a channel. With `frame: fitted` only points of which all coordinates are read, and
    whole orientations beside them, moved as these points lie best on their predictions
measurements.nominal[].rms number: in `unit`
measurements.nominal[].expected number: rms that ranges and noise explain, in `unit`
measurements.nominal[].max number: largest, in `unit`
measurements.nominal[].unit text:
measurements.nominal[].file text: where it is largest
measurements.nominal[].line integer:
measurements.nominal[].id text?: or null
measurements.warnings~[] text: sensors without a reading, duplicate rows, forces beyond limits at nominal parameters
---
verification~.compatible flag: whether all readings agree with the parameters (p >= 0.01) and every row has a
    prediction
verification.chi2 number?: of all errors, with the joint covariance of predictions and readings
verification.degrees_of_freedom integer: number of readings, less what was fitted to them
verification.p_value number?: null without degrees of freedom
verification.fitted[] text: parameters fitted to these rows: frames of instruments that stand anew, those of sessions
verification.channels[].name text: a channel
verification.channels[].rms number?: of measured less predicted, in `unit`
verification.channels[].max number?: largest
verification.channels[].u_predicted number: expanded uncertainty (k = 2) of the predictions, rms
verification.channels[].u_measured number: the same of the readings, with that of the drives' readings
verification.channels[].e_n_max number: largest normalised error
verification.channels[].n_above integer: number of readings with a normalised error above 1
verification.channels[].count integer: number of readings
verification.channels[].unit text:
verification.above[].file text: a reading with a normalised error above 1
verification.above[].line integer:
verification.above[].id text?: or null
verification.above[].channel text:
verification.above[].error number: in `unit`
verification.above[].unit text:
verification.above[].e_n number: normalised error
verification.n_failed integer: number of rows without a prediction
verification.failed[].file text: such a row
verification.failed[].line integer:
verification.failed[].id text?: or null
verification.failed[].reason text: why it has no prediction
verification.tolerance?.value number?: of `--tolerance`, in `unit`; `tolerance` is null without
verification.tolerance.unit text:
verification.tolerance.verdict pass|fail|undecided: `pass`, `fail` or `undecided`, by ISO 14253-1
verification.tolerance.n_pass integer: number of points
verification.tolerance.n_fail integer:
verification.tolerance.n_undecided integer:
verification.tolerance.largest.file text: the point that is furthest off
verification.tolerance.largest.line integer:
verification.tolerance.largest.id text?: or null
verification.tolerance.largest.error number: its distance from the predicted point, in `unit`
verification.tolerance.largest.expanded_uncertainty number: of the instrument (k = 2)
""",
)
