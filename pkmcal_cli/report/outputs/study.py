"""What `study --json` writes."""

from __future__ import annotations

from pkmcal_cli.report.outputs.keys import Output

STUDY = Output(
    "study",
    """
verdict complete|some_failed|none_calibrated: whether calibrations failed: none, some or all
noise text: as given
n_repeat integer: calibrations of each machine and number of points
held[].machine text: a machine
held[].drawn[] text: its parameters that are not identified, and are off nominal as their ranges say
n_validation integer: other points at which the tool point is compared
region.names[] text: coordinates of the tool point that are drawn
region.low[] number: their lowest value, m or rad
region.high[] number: their highest value
cases[].machine text: a machine
cases[].points integer: number of measured points
cases[].n_calibrations integer: calibrations that converged, and leave noise
cases[].n_failed integer: those that did not, or that leave more than noise (a false minimum); they are in no mean
cases[].kinds[].kind text: dimension of parameters, as `length`
cases[].kinds[].mean number?: mean absolute error of the machine's parameters of this kind, in `unit`; null if there is
    no calibration
cases[].kinds[].std number?: standard uncertainty of this mean; null of fewer than two
cases[].kinds[].common~.mean number?: the same of those parameters that all machines have; absent without
cases[].kinds[].common.std number?:
cases[].kinds[].unit text: of these
cases[].parameters[].name text: an identified parameter
cases[].parameters[].mean number?: mean absolute error in `unit`
cases[].parameters[].std number?: its standard uncertainty
cases[].parameters[].unit text: its unit
cases[].tool.mean number?: mean distance of the tool point from where it was found to be, in `unit`
cases[].tool.std number?: its standard uncertainty
cases[].tool.unit text: of these
differences[].machine text: a machine that is compared with the first one
differences[].points integer: number of measured points
differences[].kinds[].kind text: dimension of parameters that both have
differences[].kinds[].mean number?: mean absolute error of this machine less that of the first, in `unit`
differences[].kinds[].std number?: standard uncertainty of this difference, by pairs
differences[].kinds[].unit text: of these
differences[].tool.mean number?: the same of the tool point
differences[].tool.std number?:
differences[].tool.unit text:
provenance.seed integer: as given
""",
)
