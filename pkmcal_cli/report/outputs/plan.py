"""What `plan --json` writes."""

from __future__ import annotations

from pkmcal_cli.report.outputs.keys import Output

PLAN = Output(
    "plan",
    """
verdict complete|reached|continue|not_reached: `complete`; with `--next` as `status`
tool_point~ text?: point whose poses are given or proposed; null if there are none
n_rows integer: number of poses of the plan with a prediction
n_failed~ integer: number of poses without a prediction, left out
failed~[].file text: such a row
failed[].line integer:
failed[].id text?: or null
failed[].reason text: why it has no prediction
effects~[].effect text: hypotheses, as in `diagnose`
effects[].at text:
effects[].parameter text: its most visible parameter
effects[].mdb number?: minimal detectable size (test at 0.1 %, missed in 20 %); null: never detectable
effects[].detected number?: size of it that is detected in 80 % of campaigns, by all tests and confirmed; null: never
effects[].numbers[].name text: each number of the effect alone
effects[].numbers[].mdb number?:
effects[].numbers[].detected number?:
effects[].numbers[].unit text:
effects[].worst?.direction.NAME number: direction among its numbers that shows least, one standard deviation of their
    priors long; `worst` is null for one number
effects[].worst.mdb number?: in lengths of this direction
effects[].worst.detected number?:
effects[].worst.absorbed_by[] text: declared parameters that take it up
effects[].status detectable|weak|invisible: `detectable` (half its plausible range is detected in 80 %), `weak` or
    `invisible`
effects[].msb number?: minimal size at which it can be separated from its nearest rival; null: never
effects[].plausible number?: half-width of its plausible range
effects[].unit text:
effects[].rival text?: the most similar hypothesis, or null
effects[].cosine number: of the angle between the two
effects[].absorbed_by[] text: declared parameters that would absorb it
groups~[][] text: names that the plan cannot separate
not_testable~[].effect text: effects that cannot be tested with the plan's columns
not_testable[].needs text:
aim?.kind text: `see`, `separate` or `determine`; `aim` is null without one
aim.figure text: `mdb`: smallest detectable (separable) size in prior standard deviations; `log_determinant`; or
    `std`, of the parameter that is aimed at
aim.before number?: for the plan; with `--next`: as it is known now; null if undetermined
aim.after number?: for the plan with the points added; with `--next`: expected with all that are needed
aim.unit text?: of `std`, else null
aim.reached flag?: whether the uncertainty aimed at is reached; null for other aims
aim.held_adds number?: what parameters that are not identified add to `std`, with `--next` 0: there it is in `after`;
    null for other aims
points[].COLUMN number: commanded positions and directions of approach (`dir.ACTUATOR`) of the points to add
bench~[].name text: length worth measuring separately: it would resolve a weak combination
bench[].sigma number: standard uncertainty assumed for it, in `unit`
bench[].unit text:
bench[].std[].name text: a parameter of the combination
bench[].std[].before number?: standard uncertainty from the plan alone; null if not observable
bench[].std[].after number?: the same with the measurement
bench[].std[].unit text:
status~ reached|continue|not_reached: `--next`, which gives no other keys than `n_rows`, `aim` and `points` besides:
    `reached`, `continue` or `not_reached`
budget~ integer: rows that may be used
needed~ integer: further rows that are expected to be needed
noise~ number?: how many times larger than stated the noise is
power~[].effect text?: simulated campaigns with this effect (`--power K`); null: without any
power[].at text?:
power[].parameter text?: its most visible parameter
power[].size number?: its size in `unit`, of either sign: that which is detected in 80 %
power[].unit text?:
power[].n_campaigns integer: number of campaigns that were diagnosed
power[].named integer: in how many it is named, and nothing else
power[].in_set integer: in how many it is one of several names
power[].other integer: in how many something else is named, or a row is called bad
power[].missed integer: in how many nothing is named
power[].lost integer: number of campaigns that could not be predicted or calibrated
provenance.seed integer: as given
""",
)
