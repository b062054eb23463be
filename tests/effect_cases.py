"""Machines with every effect of the catalogue at every place, and tables that show them all."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache

import numpy as np

from pkmcal_cli.base.rotation import Array
from pkmcal_cli.compiler import compile_machine
from pkmcal_cli.compiler.placed_effects import placed_effect, possible_effects
from pkmcal_cli.language.effect_numbers import EffectNumber
from pkmcal_cli.language.machine_yaml import read_machine
from pkmcal_cli.model.model import Model
from pkmcal_cli.model.tool_motion import DIRECTIONS
from pkmcal_cli.prediction import Rows
from pkmcal_cli.prediction.inverse_kinematics import drive_positions
from tests.command import MACHINES
from tests.elastic_guide import TOWERS, sliders
from tests.instruments import PLANAR_INSTRUMENTS, SPATIAL_INSTRUMENTS
from tests.kinds import PLANAR_KINDS, SPATIAL_KINDS
from tests.support import described

NAMES = ("triglide", "triglide-nonredundant", "biglide", "scissors", "delta4", "hexapod7", "hangprinter")
WRITTEN = {"elastic-guide": sliders(), "elastic-towers": TOWERS, "planar-kinds": PLANAR_KINDS,
           "spatial-kinds": SPATIAL_KINDS, "planar-instruments": PLANAR_INSTRUMENTS,
           "spatial-instruments": SPATIAL_INSTRUMENTS}  # fmt: skip
"""Machines of the tests, by name."""
IN_CI = ("triglide", "delta4", "hangprinter", "elastic-guide", "planar-kinds", "planar-instruments")
"""Of all these, machines that have every effect of the catalogue between them, in the plane and in space."""
_REACH = {"hangprinter": 0.012, "planar-kinds": 0.004}  # of the machine's size; the others are moved by 4 %
_MOVES = {"spatial-kinds": (1e-3, -0.3, 5e-4, 0.01, -1e-3)}  # of drives, m or rad; its inverse positions are many
_ERRORS = {"hangprinter": 0.003}  # of the ranges; the others' parameters are off by a third
_PERIOD = EffectNumber().model_copy(update={"value": 0.01})


@dataclass(frozen=True)
class Case:
    """A model with all effects at null, parameter values (P,) of a strained machine, a table; `first`: of effects."""

    model: Model
    values: Array
    rows: Rows
    first: int

    @property
    def names(self) -> tuple[str, ...]:
        """Parameters of effects."""
        return self.model.names[self.first :]


@cache
def case(name: str, rows: int = 10) -> Case:
    """A machine at random poses, with every column that an effect can need."""
    machine = described(WRITTEN[name]) if name in WRITTEN else read_machine(MACHINES / f"{name}.yaml")
    model = compile_machine(machine, receptive=True).model
    rng = np.random.default_rng(1)
    pose = np.full((rows, 6), np.nan)
    for k, c in enumerate(DIRECTIONS[:3]):
        if c in model.independent_coordinates:
            pose[:, k] = model.tool.reference[k] + rng.uniform(-1, 1, rows) * _REACH.get(name, 0.04) * model.length
    moves = np.array(_MOVES.get(name, np.zeros(len(model.actuators))))
    if moves.any():
        readings = model.reference_readings + moves * rng.uniform(0.3, 1, (rows, len(moves)))
    else:
        readings = drive_positions(model, pose).readings
    columns = {
        "time": np.linspace(0, 3600, rows),
        "T": 293.15 + rng.uniform(-5, 5, rows),
        "payload": rng.uniform(0, 10, rows),
        "spindle": rng.uniform(0, 6, rows),
        "session.s1": (np.arange(rows) % 2 == 0).astype(float),
        "session.s2": (np.arange(rows) % 2).astype(float),
    }
    columns |= {f"dir.{a.name}": rng.choice([-1.0, 1.0], rows) for a in model.actuators}
    effects, parameters = [], []
    for effect, at, sites in possible_effects(model, ("s1", "s2")):
        entries = {o.name: _PERIOD for o in effect.options if o.name == "period"}
        placed, mine = placed_effect(effect, at, sites, machine.space == "planar", entries)
        effects.append(placed)
        parameters += mine
    values = model.nominal + rng.normal(size=len(model.names)) * _ERRORS.get(name, 0.3) * model.ranges
    full = model.with_effects(tuple(effects), tuple(parameters))
    nulls = np.zeros(len(parameters))
    partner = (np.arange(rows) + 1) % rows if any(s.kind.joins for s in model.sensors) else None
    table = Rows(readings, np.full(readings.shape, np.nan), columns, partner)
    return Case(full, np.append(values, nulls), table, len(model.names))
