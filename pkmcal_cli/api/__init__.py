"""Elasto-geometrical calibration of parallel kinematic machines, from Python.

    import pkmcal
    machine = pkmcal.load("triglide")
    found = pkmcal.calibrate(machine, pkmcal.shipped("triglide.csv"))
    found.parameters, found.residuals, found.plot()

Every function does what the command of its name does, by the same code. Tables are paths, DataFrames or arrays with
units; results are frozen, and their tables are DataFrames with units in the names of columns (`x [mm]`) or in a column
`unit`. Errors are `PkmcalError`: `BadInput` (files and tables), `UsageError` (options), `OutputError` (writing).

Stable, within the rules of semantic versions: the names in `__all__`, the options of functions and the properties and
methods of results that have no leading underscore and are not called "not stable". Modules `pkmcal.*` and the package
`pkmcal_cli` are not. docs/python.md has examples.
"""

if __name__ != "pkmcal":  # found as a folder of the checkout: there would be two of every class
    raise ImportError("this package is `pkmcal`: install the checkout (`pip install -e .`), then `import pkmcal`")

from pkmcal_cli import __version__
from pkmcal_cli.base.errors import BadInput, Fault, Location, OutputError, PkmcalError, PkmcalWarning, UsageError

from .calibration import Calibration, calibrate
from .correction import Correction, correct
from .diagnosis import Diagnosis, diagnose
from .improvement import Improvement, improve
from .machine import Machine, load, machines, shipped
from .observability import Observability, observe
from .simulation import Simulation, simulate

__all__ = [
    "BadInput", "Calibration", "Correction", "Diagnosis", "Fault", "Improvement", "Location", "Machine",
    "Observability", "OutputError", "PkmcalError", "PkmcalWarning", "Simulation", "UsageError", "__version__",
    "calibrate", "correct", "diagnose", "improve", "load", "machines", "observe", "shipped", "simulate",
]  # fmt: skip
