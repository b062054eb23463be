"""What `new --json` writes."""

from __future__ import annotations

from pkmcal_cli.report.outputs.keys import Output

NEW = Output(
    "new",
    """
verdict complete: `complete`
kind~ text: of a kind of machine: its name
span~ number: its span, m
firmware~ text: `Klipper` or `RepRapFirmware`
kinematics~ text: `delta`, `winch`, `reprap-delta` or `hangprinter`
constants~.NAME.value text: a constant as the file writes it
constants.NAME.file text: where it stands; of a default of the firmware, where the kinematics is stated
constants.NAME.line integer:
notes[] text: what was not read
output text: the machine file
""",
)
