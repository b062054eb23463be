"""Writes machines/scissors-shopfloor.csv: `python -m tests.truth.shopfloor [FOLDER]`. An exercise: its answer is here.

80 poses of the Scissors Kinematics, grid encoder of 0.5 um, over four hours in which the hall warms and cools. What
scissors.yaml does not declare: a backlash of 12 um at drive q3, growth of all five rods by 9e-6 per K above 20 degC,
and one bad row (p37). The logged temperature is that of the rods, the payload is constant: no shape but the named one.
"""

from __future__ import annotations

import sys
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from .campaigns import Campaign, Planted, Scenario, campaign
from .dimensions import MM
from .generate import FOLDER, METHOD
from .pinned_machine import Machine
from .shop_plans import PLANS
from .sidecar import write_sidecar

NAME, MACHINE = "scissors-shopfloor", "scissors"
SEED, ROWS = 2015, 80
PLANTED = (
    Planted("backlash", "q3", {"b": 12e-6}),
    Planted("thermal_strut", "all", {"a": 9e-6}),
)
SCENARIO = Scenario(outliers=1 / ROWS, sessions=1, payload=3.0, omit=("session", "payload"), extra=0.0)


def shopfloor() -> Campaign:
    """The campaign of the file."""
    return campaign(MACHINE, PLANTED, SEED, ROWS, SCENARIO)


def provenance(measured: Campaign) -> Mapping[str, Any]:
    """What stands beside the file; not which effects are in it."""
    angles = PLANS[MACHINE].angles
    true = {
        name: {"value": value, "unit": "rad"} if name in angles else {"value": value / MM, "unit": "mm"}
        for name, value in ((name, float(value)) for name, value in measured.parameters.items())
    }
    return {
        "data": f"{NAME}.csv",
        "kind": "simulated",
        "generator": "python -m tests.truth.shopfloor",
        "method": METHOD[Machine] + "; independent of the engine, no code in common",
        "control": "all drives position-controlled; set values of the nominal machine, strain-free",
        "seed": {"errors": SEED, "noise": SEED},
        "rows": ROWS,
        "noise": {"distribution": "normal", "standard_deviation": {"position": "0.5 um"}},
        "planted": {
            "distribution": "nominal + normal error, standard deviation = range / 2",
            "parameters": true,
            "undeclared": "effects that the machine file does not declare; the generator's source names them",
        },
    }


def main(folder: Path = FOLDER) -> None:
    """Writes the table and its sidecar."""
    folder.mkdir(parents=True, exist_ok=True)
    measured = shopfloor()
    (folder / f"{NAME}.csv").write_text(measured.csv_text(), encoding="utf-8", newline="")
    write_sidecar(folder / f"{NAME}.csv", provenance(measured))


if __name__ == "__main__":
    main(*(Path(argument) for argument in sys.argv[1:2]))
