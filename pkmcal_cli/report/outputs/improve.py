"""What `improve --json` writes."""

from __future__ import annotations

from pkmcal_cli.report.outputs.keys import Output

IMPROVE = Output(
    "improve",
    """
verdict clean|sigma_too_small|improved|not_confirmed: `clean`, `sigma_too_small`, `improved` or `not_confirmed`
implausible[] text: why the result is not to be believed; empty if it is
failures[] text: `missing`: something significant is left; `not_confirmed`: report rows do not confirm what was
    accepted; `sigma_too_small`; `implausible` (not with `--accept`)
diagnosis text: verdict of the diagnosis of all rows
provisional flag: whether something unknown remains, or one of the effects found is provisional, as in `diagnose`
rotations integer: number of splits of the table; in each, one block serves only for reporting
only[] text: effects that alone were tested (`--only`); empty if all were
steps[].effect text: effects tried, as in `diagnose`
steps[].at text:
steps[].accepted flag:
steps[].reason text?: why it was rejected; null if it was accepted
steps[].chosen integer: number of rotations in which the other rows named it too
steps[].confirmed flag: whether the error on the report rows falls by it, by its 95 % interval; this does not decide
    whether it is accepted
steps[].fit.KIND.rms number?: error with it on the rows used for fitting
steps[].fit.KIND.unit text:
steps[].choose.KIND.rms number?: error on the rows used for selection, held out by blocks
steps[].choose.KIND.unit text:
steps[].report.KIND.rms number?: error on the report rows, used neither for fitting nor for selection
steps[].report.KIND.unit text:
before.KIND.rms number?: error on the report rows, calibrated without effects
before.KIND.max number?:
before.KIND.criterion number?:
before.KIND.unit text:
before.KIND.count integer:
after.KIND.rms number?: the same with the accepted effects
after.KIND.max number?:
after.KIND.criterion number?:
after.KIND.unit text:
after.KIND.count integer:
channels_before.CHANNEL.rms number?: the same for every measured channel
channels_before.CHANNEL.max number?:
channels_before.CHANNEL.criterion number?:
channels_before.CHANNEL.unit text:
channels_before.CHANNEL.count integer:
channels_after.CHANNEL.rms number?:
channels_after.CHANNEL.max number?:
channels_after.CHANNEL.criterion number?:
channels_after.CHANNEL.unit text:
channels_after.CHANNEL.count integer:
chi2_before number?: mean square of the whitened residuals on the report rows
chi2_after number?:
improvement.value number?: reduction of the rms of `improvement.kind` on the report rows
improvement.low number?: 95 % interval, by block resampling
improvement.high number?:
improvement.unit text:
improvement.kind text: kind of readings, as `kind` of `diagnose`; another where the report rows have none of it
outliers[].file text: rows not used at all
outliers[].line integer?: null for a bench measurement, which is in the machine file
outliers[].id text:
bench[].name text: readings of the bench that the rows contradict, as in `diagnose`
bench[].file text:
bench[].line integer?:
bench[].reading number:
bench[].predicted number:
bench[].std number:
bench[].off number:
bench[].unit text:
bench[].deviation number:
bench[].used flag:
down_weighted[].file text: with a robust `--loss`: file of a value whose deviation exceeds 3.5 standard uncertainties;
    see `outliers` of `calibrate`
down_weighted[].line integer?:
down_weighted[].id text?:
down_weighted[].channel text:
down_weighted[].off number:
down_weighted[].unit text:
down_weighted[].deviation number:
down_weighted[].weight number?:
down_weighted[].leverage number?:
down_weighted[].moves text?:
down_weighted[].by_std number?:
n_failed integer: number of rows without a prediction, or with one only through drive errors; not used
failed[].file text: such a row
failed[].line integer?:
failed[].id text?: or null
failed[].reason text: why it has no prediction
loss text: as asked for by `--loss`
prior text: as asked for by `--prior`: of the identified parameters, not of effects
machine text?: file of the improved machine; null if nothing was written
parameters text?: file of its parameters; null without `-o`
gates[].gate text: a limit of `--fail-above` or `--max-rms`, as written
gates[].what text: what it is held against
gates[].value number?: in `unit`; null where it is not known (the limit is then missed)
gates[].limit number?:
gates[].unit text:
gates[].kept flag: whether the value is not above the limit
provenance.seed integer: as given
provenance.measured_from~ text: date of the first row, UTC, where the table's times are dates
provenance.measured_to~ text: of the last row
provenance.status text: how the fit with all that was accepted ended
provenance.implausible~[] text: as `implausible`, if there is any
provenance.accepted~[] text: the same with `--accept`
""",
)
