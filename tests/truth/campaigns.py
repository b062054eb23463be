"""Measurement campaigns on machines with effects that their machine files do not declare.

    planted = [unit("scissors", "backlash", "q2", seed=1).scaled(2)]
    text = campaign("scissors", planted, seed=1).csv_text()

The truth is a minimum of energy of pinned rods (`fast_pinned`), with effects of own discrepancy (`effects_true`,
`instrument_true`); nothing is shared with the engine. SI units; the table is in mm, degC, kg, s.
"""

from __future__ import annotations

import csv
import io
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from fnmatch import fnmatchcase

import numpy as np
from numpy.typing import NDArray

from .dimensions import MM
from .families_true import families, unit, unknown_families
from .fast_pinned import Array
from .noise_true import gross_shifts, unit_noise
from .planted import Planted
from .shop_conditions import Conditions, Scenario, conditions
from .shop_plans import MACHINES, PLANS, true_parameters
from .shop_truth import truth

__all__ = ["MACHINES", "Campaign", "Planted", "Scenario", "campaign", "families", "unit", "unknown_families"]


@dataclass(frozen=True, kw_only=True)
class Campaign:
    """N rows of C channels: readings with and without noise (N, C) in m, stated noise `sigma` (C,) in m, true
    `parameters` in SI (those which the machine file identifies), planted effects, circumstances, bad rows `outlier`
    (N,), seed of the noise."""

    machine: str
    planted: tuple[Planted, ...]
    scenario: Scenario
    parameters: Mapping[str, float]
    conditions: Conditions
    readings: Array
    true_readings: Array
    sigma: Array
    outlier: NDArray[np.bool_]
    noise_seed: tuple[int, ...]

    def columns(self) -> dict[str, list[str]]:
        """Cells of the table by heading."""
        plan, rows = PLANS[self.machine], self.conditions
        table = {
            "id": [f"p{n + 1}" for n in range(len(rows.q))],
            "time [s]": [f"{t:.1f}" for t in rows.time],
            "session": [f"s{n}" for n in rows.session],
            "T [degC]": [f"{t:.3f}" for t in rows.temperature],
        }
        table |= {f"T.{part} [degC]": [f"{t:.3f}" for t in felt] for part, felt in rows.part.items()}
        table["payload [kg]"] = [f"{m:g}" for m in rows.payload]
        table |= {f"dir.{q}": [f"{d:.0f}" for d in way] for q, way in zip(plan.drives, rows.direction.T, strict=True)}
        table |= {f"{q} [mm]": [f"{v / MM:.6f}" for v in s] for q, s in zip(plan.drives, rows.q.T, strict=True)}
        read = zip(plan.channels, self.readings.T, strict=True)
        table |= {f"{channel} [mm]": [f"{v / MM:.6f}" for v in values] for channel, values in read}
        omitted = self.scenario.omit
        return {h: v for h, v in table.items() if not any(fnmatchcase(h.split(" [")[0], o) for o in omitted)}

    def csv_text(self) -> str:
        """The measurement table."""
        table, out = self.columns(), io.StringIO()
        writer = csv.writer(out, lineterminator="\n")
        writer.writerow(table)
        writer.writerows(zip(*table.values(), strict=True))
        return out.getvalue()


def campaign(
    machine: str, planted: Sequence[Planted], seed: int, rows: int = 192, scenario: Scenario | None = None
) -> Campaign:
    """Measures a machine with planted effects. True parameters, air and what is drawn inside effects come from the
    seed alone; poses, order and noise also from `scenario.stream`, so another stream is a hold-out on the same day."""
    scenario = scenario or Scenario()
    plan, stream = PLANS[machine], scenario.stream
    parameters = true_parameters(plan, seed, scenario.errors)
    here = conditions(plan, seed, rows, scenario)
    reference = here if stream == 0 else conditions(plan, seed, rows, replace(scenario, stream=0))
    true = truth(
        plan, plan.geometry(parameters), here, planted, extra=scenario.extra, seed=seed, reference=reference
    ).readings
    sigma = np.full(len(plan.channels), plan.sigma)
    noise_seed = (seed, 6, stream)
    rng = np.random.default_rng(noise_seed)
    noise = scenario.sigma_factor * sigma * unit_noise(scenario.noise, *true.shape, rng)
    gross, bad = gross_shifts(scenario.outliers, sigma, rows, rng)
    return Campaign(
        machine=machine,
        planted=tuple(planted),
        scenario=scenario,
        parameters={name: parameters[name] for name in plan.identified},
        conditions=here,
        readings=true + noise + gross,
        true_readings=true,
        sigma=sigma,
        outlier=bad,
        noise_seed=noise_seed,
    )
