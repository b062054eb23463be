"""What `diagnose --json` writes."""

from __future__ import annotations

from pkmcal_cli.report.outputs.keys import Output

DIAGNOSE = Output(
    "diagnose",
    """
verdict clean|found|ambiguous|unknown|measurement_fault|sigma_too_small|implausible: `clean`, `found`, `ambiguous`,
    `unknown`, `measurement_fault`; `sigma_too_small`: no cause is found, but the stated noise would leave residuals
    this large in fewer than 1 of 1000 tables; `implausible`: no cause is found, but the calibration should not be
    believed
mistakes[] text: gross mistakes of the table (columns exchanged, reversed in sign, in a wrong unit, readings in wrong
    rows) that were put right before it was searched; the verdict is then never `clean`
implausible[] text: why not, as in `calibrate`, or that it does not converge; empty with every other verdict
sigma text: noise on which the tests are based: `stated`, or `estimated` if the residuals show more, or much less
sigma_factor number: ratio of noise to stated sigma
noise_correlation number: of successive rows, which were made independent before testing; 0 if they are independent
noise_models[].effect text: `noise_model`: noise of a sensor that grows over the workspace; rows are weighted by it
noise_models[].at text: the sensor
noise_models[].towards text: `distance` from its origin, or a side, such as `x+`
noise_models[].ratio number?: standard deviation at the far end of the table over that at the near end
noise_models[].ratio_std number?: its standard uncertainty
noise_models[].slope number?: of `distance`: sigma^2 = level stated^2 + (slope distance)^2, with a level as large as
    the residuals say; else null
noise_models[].std number?: standard uncertainty
noise_models[].unit text:
noise_models[].p_value number?: of the hypothesis of no growth
chi2_per_dof_before number?: after calibration, without effects and without the rejected rows
chi2_per_dof_after number?: with the accepted effects
p_value number?: of the same residuals, if sigma is as stated
kind text: kind of readings of which errors are told as one figure: that with the largest residuals for its noise;
    `position`, or the first, where all agree with it
effects[].effect text: keyword, or `release` for a parameter that is held at nominal
effects[].at text: place, or the parameter's name
effects[].parameters[].name text: full name
effects[].parameters[].value number?: estimate in `unit`
effects[].parameters[].std number?: standard uncertainty, with what parameters that are not identified add; null if
    undetermined
effects[].parameters[].unit text:
effects[].evidence number?: log Bayes factor on acceptance
effects[].p_value number?: p-value on acceptance, before allowing for selection
effects[].share number?: share of what all effects explain that is lost if only this one is removed; shares need not
    add up to 1; null if no fit omits it
effects[].credible_set[].effect text: hypotheses that together hold 95 % of the evidence, best first
effects[].credible_set[].at text:
effects[].credible_set[].weight number: share of the evidence
effects[].credible_set[].cosine number: 1: these data cannot separate it from the effect
effects[].runner_up?.effect text: the best hypothesis outside the credible set; `runner_up` is null where there is
    none, or the effect is far off
effects[].runner_up.at text:
effects[].runner_up.log_odds number?: natural logarithm of the odds against it
effects[].heldout_rms number?: of `kind`, on rows held out by blocks, with all effects, in the effect's `unit`
effects[].heldout_rms_without number?: the same without this effect
effects[].unit text: of both
effects[].confirmed flag: whether the held-out gain exceeds its standard error
effects[].stable number?: share of 100 block resamples of the rows that name it or a member of its set; null if the
    fit differs from what the score predicts
effects[].otherwise[].effect text: what the other resamples name, most often first
effects[].otherwise[].at text:
effects[].otherwise[].share number?: of all resamples
effects[].likelihood_ratio_over_score number?: fall of chi-square in the fit over that predicted by the score: 1 if it
    acts in proportion to its size; null if no fit omits it
effects[].selection?.factor number: median of true sizes that fit, allowing for being found, over the
    estimate; `selection` is null where it does not matter
effects[].selection.low number?: lower end of its 95 % interval, over the estimate
effects[].selection.high number?: upper end
effects[].far_off?.NAME number?: by how much this declared parameter comes out off nominal without the effect, in its
    unit; `far_off` is null unless the effect is far larger than what is usual
effects[].provisional flag: whether it is unconfirmed, implausible, named by less than 80 % of resamples, or
    accompanied by an unknown effect
outliers[].file text: rows rejected as bad
outliers[].line integer?: null for a bench measurement, which is in the machine file
outliers[].id text:
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
bench[].name text: a sensor whose bench reading contradicts the rows of the table
bench[].file text: machine file in which the reading stands
bench[].line integer?:
bench[].reading number: in `unit`
bench[].predicted number: the same as the rows predict it, without this reading
bench[].std number: standard uncertainty of `predicted`
bench[].off number: reading minus `predicted`
bench[].unit text:
bench[].deviation number: `off` in its standard uncertainty, which includes the sigma of the reading
bench[].used flag: whether it is used all the same: a diagnosis leaves out what is beyond all doubt
suspected[].file text: rows that may be bad (5 %), but are not off far enough to be rejected; used
suspected[].line integer?: null for a bench measurement, which is in the machine file
suspected[].id text?:
suspected[].p_value number?: chance that any row of good ones is off as much
n_failed integer: number of rows without a prediction, or with one only through drive errors; not used
failed[].file text: such a row
failed[].line integer?:
failed[].id text?: or null
failed[].reason text: why it has no prediction
unknown[].depends_on text: `pose`, `time`, `temperature`, `direction`, `load`, `position`, or `the reading of DRIVE`
unknown[].rms number?: size; null if it has none
unknown[].unit text:
unknown[].p_value number?:
unknown[].hint text?: description; null without one
unknown[].largest?.x number: position at which a smooth map of the residuals is largest; `largest` is null if there is
    no map
unknown[].largest.y number:
unknown[].largest.z number: in space
unknown[].largest.size number?: size at that position, in `unit`
unknown[].largest.unit text:
unknown[].largest.explained number?: share of the variance that the map explains on held-out cells
wrong_numbers[].places[] text: where a number stands in the machine file that no parameter changes, as `POINT.x` or
    `ROD.length`; by itself it explains the table at least as well as what was found; the most evident first
wrong_numbers[].nominal number: as the file has it, in `unit`
wrong_numbers[].value number: as the table has it
wrong_numbers[].std number: standard uncertainty of `value`
wrong_numbers[].unit text:
wrong_numbers[].chi2_per_dof number: of the fit with it
unexplained[].name text: a displacement with a free shape, `unexplained@PLACE`; those without an `effect` are the first
    ones of `unknown`, whose `hint` is this name
unexplained[].effect text?: the effect of the catalogue whose shape it is for the most part; null: it has no name
unexplained[].at text: drive or guide, with `:time` where it depends on time
unexplained[].knots[] number?: places on its axis, in `knots_unit`
unexplained[].knots_unit text:
unexplained[].values[] number?: deviation at the knots, in `unit`
unexplained[].std[] number?: standard uncertainties of these, with what parameters imitate
unexplained[].height number?: from its lowest knot to its highest, whatever its level; across a guide, off the line
    that fits it best
unexplained[].height_std number?: standard uncertainty of this difference
unexplained[].unit text:
unexplained[].spread number?: likeliest standard deviation of such a shape, in `unit`
unexplained[].width number?: likeliest distance over which it changes, in `knots_unit`
unexplained[].evidence number?: log evidence over what it replaced
unexplained[].places[].at text: where it may be, the first where it is
unexplained[].places[].weight number?: share of the evidence
unexplained[].heldout_rms number?: as `effects[].heldout_rms`, in `heldout_unit`
unexplained[].heldout_rms_without number?:
unexplained[].heldout_unit text:
unexplained[].hidden.PARAMETER number?: standard uncertainty of a parameter by what the shape may hide in it, in the
    parameter's unit
unexplained[].would_name_it[].effect text: an effect at its place that the table cannot show
unexplained[].would_name_it[].needs text: what it needs
not_testable[].effect text: effects that cannot be tested with this table
not_testable[].needs text: what the table lacks
detectable[].effect text: hypotheses that these data would have revealed
detectable[].at text:
detectable[].parameter text: its most visible parameter
detectable[].mdb number?: minimal detectable size (test at 0.1 %, missed in 20 %)
detectable[].detected number?: size of it that is detected in 80 % of campaigns, by all tests and confirmed; null:
    never
detectable[].unit text:
detectable[].numbers[].name text: each number of the effect alone
detectable[].numbers[].mdb number?:
detectable[].numbers[].detected number?:
detectable[].numbers[].unit text:
detectable[].worst?.direction.NAME number: direction among its numbers that shows least, one standard deviation of
    their priors long; `worst` is null for one number
detectable[].worst.mdb number?: in lengths of this direction
detectable[].worst.detected number?:
detectable[].worst.absorbed_by[] text: declared parameters that take it up
invisible[].effect text: hypotheses that these data could not have revealed within their plausible range
invisible[].at text:
invisible[].parameter text: its most visible parameter
invisible[].mdb number?: minimal detectable size; null: never detectable
invisible[].detected number?: size of it that is detected in 80 % of campaigns, by all tests and confirmed; null:
    never
invisible[].unit text:
invisible[].numbers[].name text: each number of the effect alone
invisible[].numbers[].mdb number?:
invisible[].numbers[].detected number?:
invisible[].numbers[].unit text:
invisible[].worst?.direction.NAME number: direction among its numbers that shows least, one standard deviation of
    their priors long; `worst` is null for one number
invisible[].worst.mdb number?: in lengths of this direction
invisible[].worst.detected number?:
invisible[].worst.absorbed_by[] text: declared parameters that take it up
invisible[].plausible number?: half-width of the plausible range
invisible[].absorbed_by[] text: declared parameters that would absorb it
invisible[].rows_needed integer?: number of rows like those of the table that would reveal it; null if more rows do
    not help
same_as[].effect text: effects that are another name for a parameter ...
same_as[].parameter text: ... and its name
effective_tests number?: number of independent tests
seed integer: of the bootstrap
loss text: as asked for by `--loss`
prior text: as asked for by `--prior`: of the identified parameters, not of effects
""",
)
