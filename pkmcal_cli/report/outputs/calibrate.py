"""What `calibrate --json` writes."""

from __future__ import annotations

from pkmcal_cli.report.outputs.keys import Output

CALIBRATE = Output(
    "calibrate",
    """
verdict converged|incomplete|not_converged|nothing_identifiable|implausible|accepted|undetermined|limit_missed:
    `status`; `accepted` where that is `implausible` and `--accept` is given (exit 0); where the exit code is 1 all the
    same: `undetermined` for a parameter named in `--select`, or `limit_missed`
status converged|incomplete|not_converged|nothing_identifiable|implausible: `converged`; `incomplete`: converged, but
    the residuals are larger than the stated noise can be, so an effect is missing or a sigma too small (exit 0;
    `diagnose` tells which); `not_converged`, `nothing_identifiable`, or `implausible`: converged, but not to be
    believed
implausible[] text: why not
incomplete[] text: instruments whose residuals are larger than their stated noise and parameters that are not
    identified can make them, and by what factor; rows and bench readings that the others contradict; empty unless
    `status` is `incomplete`
n_rows integer: number of rows in all tables
n_failed integer: number of rows without a prediction, not used
failed[].file text: such a row
failed[].line integer:
failed[].id text?: or null
failed[].reason text: why it has no prediction
loads.force_limit[].actuator text: an actuator with `force_limit`
loads.force_limit[].limit number?: N or N m
loads.force_limit[].n_rows integer: number of rows with a larger force
loads.force_limit[].largest number?: largest force of these rows
loads.force_limit[].row text?: its `id` or line, or null
loads.t_min[].rope text: a rope with `t_min`
loads.t_min[].limit number?: N
loads.t_min[].n_rows integer: number of rows with less tension
loads.t_min[].least number: least tension of these rows
loads.t_min[].row text: as above
loads.disagreement.n_rows integer: number of rows in which the actuators strain the structure by more than parameter
    ranges and noise explain, and more than 0.001 of the machine's size; 0 if all actuators have a `force_limit`
loads.disagreement.largest number?: largest disagreement, m
loads.disagreement.row text?: as above
loads.slack.n_rows integer: number of rows with slack ropes
loads.slack.ropes.ROPE integer: number of rows in which the rope is slack
iterations integer: number of steps of the fit
stopped gradient|step|rounding|noise|budget|no_descent|abandoned|nothing: why the fit ended: no step lowers chi-square
    by more than 1e-11 of it (`gradient`), or by more than rounding; steps long gained less than noise as what is held
    turns on the way (`noise`); the next step is shorter than 1e-8 of the ranges (`step`); all
    steps that it may take are taken (`budget`); no step of any length lowers chi-square, as the prediction fails
    (`no_descent`); no fit soon explains readings that look wrong, start values are kept (`abandoned`); nothing is to be
    identified (`nothing`)
parameters[].name text: a selected parameter
parameters[].nominal number: nominal value in `unit`
parameters[].value number?: identified value
parameters[].std number?: standard uncertainty: 1.96 times it is the half-width of a 95 % interval; null if
    undetermined
parameters[].std_by_data number?: the part of it that noise and held combinations make
parameters[].std_by_held number?: the part that `uncertainty.held` makes
parameters[].interval?[] number: both ends of the 95 % interval; null if undetermined
parameters[].range number: half-width about nominal
parameters[].unit text: `1` for a plain number
parameters[].identified flag: whether it is determined by the data, not only by its range
parameters[].reason text?: why it is undetermined, weak, in part held, at its bound, or far from nominal; else null
before.KIND.rms number?: error at the starting values: `position`, `orientation`, the kinds of the other sensors
    (`touch`, `distance`, ...), `drive`; `length`, by how much drives and structure are apart: on a machine that is
    strained `strain`, with what it yields under its own forces, which is no error; `KIND (DIMENSION)` where one kind
    reads several
before.KIND.max number?: largest
before.KIND.criterion number?: sum of squares, in the square of `unit` (the paper's criterion)
before.KIND.unit text:
before.KIND.count integer: number of points (position, orientation) or readings
after.KIND.rms number?: the same, at the identified values
after.KIND.max number?:
after.KIND.criterion number?:
after.KIND.unit text:
after.KIND.count integer:
chi2 number?: weighted sum of squares
degrees_of_freedom integer: measured values minus determined combinations
chi2_per_dof number?: about 1 if sigma is right and the model complete; null without degrees of freedom
uncertainty.method linear|profile|bootstrap: `linear`, `profile` or `bootstrap`
uncertainty.noise.INSTRUMENT number: by what its stated sigma is multiplied, as the residuals say
uncertainty.ranges.p_value number?: probability of values so far from nominal, or so near, if the ranges are right
    (two-sided); reported below 0.01; null with a parameter file as prior
uncertainty.ranges.factors.KIND number: by what the ranges of a kind of parameters are multiplied: `length`, `angle`,
    `stiffness`, `zero` (of drives), ...
uncertainty.held[] text: parameters that are not identified and known to their ranges
uncertainty.held_explain[] text: those few of them that explain the most of residuals larger than noise, where all of
    them together explain at least half within their ranges; otherwise empty
uncertainty.overstated.CHANNEL number: how many times too large the sigma of a channel is stated, as its residuals say;
    only where their mean square is below 0.05 of what is stated: check its unit
uncertainty.remark text?: remark on the intervals, or null
outliers[].file text: file of a value whose deviation exceeds 3.5 standard uncertainties
outliers[].line integer?: null for a bench measurement, which is in the machine file
outliers[].id text?: of the row, or null
outliers[].channel text:
outliers[].off number: deviation from the prediction of the fit and the other readings of its row, in `unit`
outliers[].unit text:
outliers[].deviation number: deviation in standard deviations of the channel's actual scatter
outliers[].weight number: weight given by a robust loss; 1 without one
outliers[].leverage number: leverage: share of the value that the fit follows
outliers[].moves text: parameter that changes most if the value stays in the fit
outliers[].by_std number: change of that parameter, in standard uncertainties
far_rows[].file text: a row that the other rows contradict, far beyond noise (6 standard deviations or more)
far_rows[].line integer?:
far_rows[].id text?: or null
bench[].name text: a sensor whose bench reading contradicts the rows of the table
bench[].file text: machine file in which the reading stands
bench[].line integer?:
bench[].reading number: in `unit`
bench[].predicted number: the same as the rows predict it, without any bench reading
bench[].std number: standard uncertainty of `predicted`
bench[].off number: reading minus `predicted`
bench[].unit text:
bench[].deviation number: `off` in its standard uncertainty, which includes the sigma of the reading
replicates[].channel text: a channel measured at repeated poses in one session; duplicate rows excluded
replicates[].n_groups integer: number of these poses
replicates[].degrees_of_freedom integer: of the noise estimate from their spread
replicates[].std number?: standard deviation of the noise in `unit`, after removing predicted differences
replicates[].sigma number: stated sigma, in `unit`
replicates[].unit text:
replicates[].p_value number?: probability of so large a difference from the stated sigma (chi-square, two-sided);
    reported below 0.01
datum?[] text: parameters held because the data do not locate the base; null if they do
gauge[] text: unobservable motions of the base, in words
starts?.starts integer: number of starts tried; `starts` is null if one was enough
starts.agree integer: number that end at the best fit
starts.rivals integer: number that end elsewhere with an equally good chi-square: the data cannot decide between them
starts.worse integer: number that end elsewhere with a higher chi-square
starts.failed integer: number that end without a fit
starts.spread number: largest parameter difference among those that agree, in standard uncertainties
starts.untried integer: number for which there was no time; 0 where `--starts` asks for a number
heldout.rms_before number?: error of `kind` on held-out rows; if there is none, all of `heldout` except `reason` is
    null
heldout.rms_after number?:
heldout.unit text?:
heldout.kind text?: first measured kind
heldout.scheme text?: how rows were held out, in words
heldout.failed_folds integer?: number of folds whose fit did not converge
heldout.before?.KIND.rms number?: as `before`
heldout.before.KIND.max number?:
heldout.before.KIND.criterion number?:
heldout.before.KIND.unit text:
heldout.before.KIND.count integer:
heldout.after?.KIND.rms number?:
heldout.after.KIND.max number?:
heldout.after.KIND.criterion number?:
heldout.after.KIND.unit text:
heldout.after.KIND.count integer:
heldout.reason text?: why there is no held-out error, or null
condition_number number?: of the whitened Jacobian at the solution, scaled by the ranges of the machine file; null if
    infinite
rank integer: number of combinations that these readings determine, scaled alike: both tell of the measurement, as
    `condition_number_whitened` and `rank` of `observability`
undetermined[].kind text?: `null` (not observable, not moved) or `weak` (weakly determined, held), as the fit took
    them: by ranges as they were estimated (`uncertainty.ranges.factors`), and with `--prior`
undetermined[].parameters.NAME number: a motion that the fit does not determine, in these ranges; every such motion is
    listed
undetermined[].text text: the same in words
undetermined[].hold[] text: parameters to hold so that the rest is determined; the same for motions that share
    parameters
undetermined[].std_in_ranges number?: of a weak combination, in ranges; null for `null`
undetermined[].std_by_data_alone number?: of a weak combination, by itself: standard uncertainty in terms of its
    strongest member, `hold[0]`, by the data alone; null for `null`
undetermined[].std_with_range number?: the same with its range
undetermined[].determined[].coefficients.NAME number: a determined sum of the members: coefficients of their values in
    their own units, the first one 1
undetermined[].determined[].value number?: its value in `unit`, that of its first member
undetermined[].determined[].std number?: its standard uncertainty
undetermined[].determined[].unit text:
method text: as asked for by `--method`
gates[].gate text: a limit of `--fail-above` or `--max-rms`, as written
gates[].what text: what it is held against
gates[].value number?: in `unit`; null where it is not known (the limit is then missed)
gates[].limit number?:
gates[].unit text:
gates[].kept flag: whether the value is not above the limit
provenance.seed~ integer?: null
provenance.measured_from~ text: date of the first row, UTC, where the table's times are dates
provenance.measured_to~ text: of the last row
provenance.status text: as `status`
provenance.method~ text: other than `exact`
provenance.implausible~[] text: as `implausible`, if there is any
provenance.accepted~[] text: the same with `--accept`
""",
)
