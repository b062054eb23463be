"""What `effects --json` writes."""

from __future__ import annotations

from pkmcal_cli.report.outputs.keys import Output

EFFECTS = Output(
    "effects",
    """
verdict complete: `complete`
effects~[].effect text: keyword
effects[].title text: standard term
effects[].symbol text?: of ISO 230, or null
effects[].source text:
effects[].stage text: `command`, `geometry`, `stiffness`, `load` or `reading`
effects[].enters text: what it changes
effects[].parameters[].name text:
effects[].parameters[].range number: plausible half-width in `unit`
effects[].parameters[].unit text:
effects[].parameters[].rotary_range integer?: the same for rotary drives, in `rotary_unit`; null if there is no
    difference
effects[].parameters[].rotary_unit text?:
effects[].parameters[].text text:
effects[].needs[] text: required columns
effects[].at?[] text: places on the machine; null without a machine
effects[].measurement flag: whether it is an error of the measurement, not of the machine
effects[].cause text: `{at}` stands for the place, `{size}` for the size, `{repeats}` for how often it comes per period
effects[].result text:
effects[].action text:
---
n_poses~ integer: number of poses
simulated~[].effect text: keyword
simulated[].at text?: place; null if the machine has none for it
simulated[].status moves|taken_up|nothing: `moves`; `taken_up`: identified parameters move the readings alike;
    `nothing`
simulated[].parameter text?: parameter that moves a reading most; null if none moves
simulated[].reading text?: the reading that it moves most, in standard uncertainties; or null
simulated[].max number?: its largest change in `unit`; or null
simulated[].rms number?: root mean square of its change over the poses; or null
simulated[].unit text?: of both; or null
simulated[].taken_up_by[] text: parameters that a calibration would move instead
simulated[].reason text?: why nothing moves, or what takes the effect up; null if it moves readings
simulated[].parameters[].name text: full name
simulated[].parameters[].size number?: plausible size at which it was simulated, alone, in `unit`
simulated[].parameters[].unit text:
simulated[].parameters[].n_lost integer: number of poses without a solution at this size
simulated[].parameters[].readings[].name text: every reading
simulated[].parameters[].readings[].max number?: its largest change in `unit`; null if it is read at no pose
simulated[].parameters[].readings[].rms number?:
simulated[].parameters[].readings[].unit text:
""",
)
