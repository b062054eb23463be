"""Whether effects that act through forces look invisible because nothing strains the machine."""

from __future__ import annotations

import numpy as np

from pkmcal_cli.loading.load_machine import LoadedMachine
from pkmcal_cli.prediction import Rows


def is_unstrained(loaded: LoadedMachine, parameters: str | None, rows: Rows) -> bool:
    """Whether a redundant machine has nominal `parameters` (None), and no drive in force control loads it at any row.

    At identified parameters its drives disagree, and strain it.
    """
    if parameters is not None or loaded.compiled.mobility.redundancy <= 0:
        return False
    model = loaded.model
    forced = [a for a, d in enumerate(model.topology.drives) if d.force_controlled]
    stated = model.topology.coefficients.constants[[model.actuators[a].force_coefficient for a in forced]]
    forces = rows.forces[:, forced]
    return not np.where(np.isnan(forces), stated, forces).any()
