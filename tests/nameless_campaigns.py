"""Campaigns with a displacement that no effect of the catalogue has, and what the diagnosis makes of them.

`python -m tests.nameless_campaigns > docs/unexplained.md`; `--cases N`, `--fields N`, `--processes N`, `--raw FILE`.
"""

from __future__ import annotations

import argparse
import json
import math
import os
import sys
import time
from collections.abc import Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path

import numpy as np

from pkmcal_cli.base.rotation import Array
from pkmcal_cli.calibration.identify import identify
from pkmcal_cli.calibration.problem import Problem
from pkmcal_cli.calibration.residual import evaluate
from pkmcal_cli.diagnosis.hypotheses import Hypothesis
from pkmcal_cli.diagnosis.run_diagnosis import Diagnosis
from pkmcal_cli.diagnosis.shape_findings import ShapeFinding
from pkmcal_cli.effects.unexplained import UNEXPLAINED
from pkmcal_cli.prediction import frozen
from tests.benchmark.setting import Setting, diagnosed, ready
from tests.truth.campaigns import MACHINES, Campaign, Planted, Scenario, campaign, unit
from tests.truth.nameless_true import LAWS, displaced
from tests.truth.planted import Context, Travel
from tests.truth.shop_plans import PLANS
from tests.truth.shop_truth import unloaded

CASES, FIELDS, SIZES = 100, 20, (3.0, 12.0)  # sizes of what is planted: in minimal detectable ones
_SPREAD = 1e-5  # m, of a trial that tells how the readings feel a shape


@dataclass(frozen=True, kw_only=True)
class Outcome:
    """What became of a case. `parameters`, `curve`: (estimate - truth) over the uncertainty stated for it."""

    number: int
    machine: str
    planted: str
    size: float
    verdict: str
    named: list[str]
    shapes: list[str]
    right: bool  # `unexplained@PLACE` comes first
    own: bool  # a named effect at the right place comes first: it is its own shape
    places: bool  # whether the right place is in the set
    before: float = math.nan
    after: float = math.nan
    ideal: float = math.nan
    parameters: list[float] = field(default_factory=list)
    curve: list[float] = field(default_factory=list)
    seconds: float = 0.0

    @property
    def gain(self) -> float:
        """Share that is reached of the ideal gain in mean square error on other poses."""
        return (self.before**2 - self.after**2) / (self.before**2 - self.ideal**2)

    @property
    def law(self) -> str:
        """Which shape was planted."""
        return self.planted.partition("@")[0]


def planted_case(number: int) -> tuple[str, int, Planted, float]:
    """Machine, seed, what is planted, its size in minimal detectable ones: shapes and places take turns."""
    rng = np.random.default_rng([7, number])
    machine, law = MACHINES[number % len(MACHINES)], list(LAWS)[number // len(MACHINES) % len(LAWS)]
    plan, seed = PLANS[machine], int(rng.integers(1_000_000))
    letters = [axis for n, axis in enumerate("xyz"[: 2 if plan.planar else 3]) if n != plan.along]
    guides = [f"{guide}.{axis}" for guide in dict.fromkeys(plan.guide) for axis in letters]
    setting = Setting.of(machine, seed)
    while True:
        at = str(rng.choice(plan.drives)) if rng.uniform() < 0.7 else str(rng.choice(guides))
        trial = Planted(f"odd_{law}", at, {"h": _SPREAD})
        size = setting.size(setting.change(trial))
        wanted = float(rng.uniform(*SIZES))
        if size * 50 > wanted:  # at most 0.5 mm
            return machine, seed, trial.scaled(wanted / size), wanted


def judged(number: int) -> Outcome:
    """Diagnoses a case with a displacement over a travel."""
    machine, seed, planted, size = planted_case(number)
    measured = campaign(machine, [planted], seed)
    start = time.process_time()
    d = diagnosed(measured, seed)
    seconds = time.process_time() - start
    shape = next((s for s in d.shapes if s.hypothesis.at == planted.at), None)
    every = [at for s in d.shapes for at, _ in s.places]
    before, after, ideal = _held_out(measured, d, planted)
    return Outcome(
        number=number,
        machine=machine,
        planted=f"{planted.keyword}@{planted.at}",
        size=size,
        verdict=d.verdict,
        named=[f.hypothesis.name for f in d.findings],
        shapes=[s.hypothesis.at for s in d.shapes],
        right=shape is not None and d.shapes[0] is shape,
        own=not d.shapes and bool(d.findings) and _at(d.findings[0].hypothesis) == planted.at,
        places=planted.at in every,
        before=before,
        after=after,
        ideal=ideal,
        parameters=_parameters(measured, d) if shape is not None else [],
        curve=_curve(measured, planted, shape) if shape is not None else [],
        seconds=seconds,
    )


def field_case(number: int) -> Outcome:
    """Diagnoses a case with a smooth field over the workspace, which has no place in the machine."""
    machine = MACHINES[number % len(MACHINES)]
    rng = np.random.default_rng([8, number])
    seed, size = int(rng.integers(1_000_000)), float(rng.uniform(1.5, 6.0))
    planted = unit(machine, "smooth_field", PLANS[machine].sensor, seed).scaled(size)
    start = time.process_time()
    d = diagnosed(campaign(machine, [planted], seed), seed)
    flagged = any(u.depends_on == "pose" for u in d.unknown)
    return Outcome(
        number=number,
        machine=machine,
        planted="smooth_field",
        size=size,
        verdict=d.verdict,
        named=[f.hypothesis.name for f in d.findings],
        shapes=[s.hypothesis.at for s in d.shapes],
        right=flagged and not d.shapes,
        own=False,
        places=flagged,
        seconds=time.process_time() - start,
    )


def _at(hypothesis: Hypothesis) -> str:
    """The place of an effect over the travel of a drive or across a guide."""
    return hypothesis.at if hypothesis.effect in ("pitch_curve", "pitch", "scale", "straight") else ""


def _held_out(measured: Campaign, d: Diagnosis, planted: Planted) -> tuple[float, float, float]:
    """rms (m) against the true readings of other poses of the same day: as calibrated, with all that was found, and of
    a calibration without what was planted."""
    other = campaign(measured.machine, [planted], measured.noise_seed[0], scenario=Scenario(stream=1))
    found = d.search.problem
    model = frozen(found.model, found.rows)
    there = replace(ready(other).problem, model=model, readings=other.true_readings)
    plain = ready(campaign(measured.machine, [], measured.noise_seed[0])).problem
    bare = campaign(measured.machine, [], measured.noise_seed[0], scenario=Scenario(stream=1))
    selected = d.search.declared
    ideal = identify(plain, selected)
    bare_there = replace(ready(bare).problem, readings=bare.true_readings)
    values = model.nominal
    own = [model.names.index(n) for n in selected]
    values[own] = d.before.values[[d.problem.model.names.index(n) for n in selected]]
    return _rms(there, values), _rms(there, d.search.fit.values), _rms(bare_there, ideal.values)


def _rms(problem: Problem, values: Array) -> float:
    return float(np.sqrt(np.nanmean(evaluate(problem, values).residual ** 2)))


def _parameters(measured: Campaign, d: Diagnosis) -> list[float]:
    """(estimate - truth) / uncertainty of the parameters, which allows for what the shape may hide in them."""
    fit, model = d.search.fit, d.search.problem.model
    out = []
    for name, true in measured.parameters.items():
        std = fit.std[fit.selected.index(name)] if name in fit.selected else math.nan
        if np.isfinite(std) and std > 0:
            error = fit.values[model.names.index(name)] - true
            out.append(float(error / (std * np.sqrt(d.scale.variance))))
    return out


def _curve(measured: Campaign, planted: Planted, shape: ShapeFinding) -> list[float]:
    """The same of the curve at the measured places of its axis."""
    plan, conditions = PLANS[measured.machine], measured.conditions
    c = unloaded(
        Context(
            plan=plan,
            geometry=plan.geometry(plan.nominal),
            conditions=conditions,
            travel=Travel.of(conditions.q),
            extra=1.0,
            seed=measured.noise_seed[0],
            force=np.zeros(0),
            tension=np.zeros(0),
        )
    )
    if "." in planted.at:
        columns, low, high = c.guide(planted.at.partition(".")[0])
        q = conditions.q[:, columns].ravel()
        u = 2 * (q - low) / (high - low) - 1
    else:
        q, u = conditions.q[:, c.drive(planted.at)], c.u(c.drive(planted.at))
    truth = displaced(planted, c, u)
    basis = shape.shape.basis(q)
    prior = shape.shape.factor
    weights = np.linalg.solve(prior, shape.curve)
    assert shape.shape.covariance is not None
    inner = np.linalg.solve(prior, np.linalg.solve(prior, shape.shape.covariance).T)
    std = np.sqrt(np.einsum("nk,kl,nl->n", basis, inner, basis) + shape.shape.missing_variance(q))
    return ((basis @ weights - truth) / std).tolist()


def _share(hits: int, count: int) -> str:
    return f"{hits} of {count}" + (f" ({100 * hits / count:.0f} %)" if count else "")


def _covered(values: Sequence[float]) -> str:
    inside = int((np.abs(values) < 1.96).sum())
    return f"{100 * inside / len(values):.1f} % of {len(values)}" if len(values) else "-"


_HEAD = """# Displacements without a name

Written by `python -m tests.nameless_campaigns`. An independent simulator plants a shape that no effect of the catalogue
has (a bump, a step, a rise like a hyperbolic tangent, waves) in the position of a drive or across a guide of one of
{machines} machines, {low:g} to {high:g} minimal detectable sizes large, in 192 rows with noise.

- right place: `unexplained@PLACE` comes first, or a named effect of the same place, which explains nearly all of it and
  whose own shape it then is (waves of two periods are nearly a `pitch_curve`); in brackets, how many have no name
- gain: fall of the mean square error on other poses, over that of a calibration of the machine without the shape
- parameters: planted parameters within 1.96 standard uncertainties, of cases without a name
- curve: the same of the curve at the measured places, averaged over these cases

| shape | right place | gain, median | gain above 70 % | parameters | curve | named besides |
| --- | --- | --- | --- | --- | --- | --- |
"""


def document(cases: Sequence[Outcome], fields: Sequence[Outcome]) -> str:
    """The page."""
    laws = [*dict.fromkeys(c.law for c in cases), ""]
    rows = [_row(law, [c for c in cases if law in ("", c.law)]) for law in laws]
    seconds = [c.seconds for c in (*cases, *fields)]
    missed = [_missed(c) for c in (*cases, *fields) if not (c.right or c.own)]
    tail = f"""
Smooth fields over the workspace, which have no place in a machine, reported as such and without a shape at a drive or
guide: {_share(sum(c.right for c in fields), len(fields))}.

Processor time of a diagnosis: {np.median(seconds):.1f} s (median), {max(seconds):.0f} s (largest).

Cases in which another place comes first, or none:

"""
    head = _HEAD.format(machines=len(MACHINES), low=SIZES[0], high=SIZES[1])
    return head + "\n".join(rows) + "\n" + tail + "\n".join(missed or ["none"]) + "\n"


def _row(law: str, own: Sequence[Outcome]) -> str:
    """A line of the table."""
    hit, gains = [c for c in own if c.right], [c.gain for c in own]
    curve = [float((np.abs(c.curve) < 1.96).mean()) for c in hit if c.curve]
    cells = [
        law.removeprefix("odd_") or "all",
        f"{_share(sum(c.right or c.own for c in own), len(own))} [{len(hit)}]",
        f"{100 * float(np.median(gains)):.0f} %",
        _share(sum(g > 0.7 for g in gains), len(own)),
        _covered([z for c in hit for z in c.parameters]),
        f"{100 * float(np.mean(curve)):.1f} %" if curve else "-",
        str(sum(bool(c.named) for c in hit)),
    ]
    return f"| {' | '.join(cells)} |"


def _missed(c: Outcome) -> str:
    """A case, and what was told of it."""
    told = [*c.named, *(f"{UNEXPLAINED}@{at}" for at in c.shapes)]
    return f"- {c.number}: {c.machine}, {c.planted}, {c.size:.1f} MDB: {c.verdict}, {', '.join(told) or 'nothing'}"


def main() -> None:
    """Draws, diagnoses and judges all cases, and prints the page."""
    parser = argparse.ArgumentParser(prog="python -m tests.nameless_campaigns")
    parser.add_argument("--cases", type=int, default=CASES)
    parser.add_argument("--fields", type=int, default=FIELDS)
    parser.add_argument("--processes", type=int, default=os.cpu_count())
    parser.add_argument("--raw", type=Path, help="file for the results, JSON lines")
    options = parser.parse_args()
    with ProcessPoolExecutor(options.processes) as pool:
        cases, fields = [], []
        for made, work, count in ((cases, judged, options.cases), (fields, field_case, options.fields)):
            for outcome in pool.map(work, range(count)):
                made.append(outcome)
                if options.raw is not None:
                    options.raw.write_text("".join(f"{json.dumps(asdict(c))}\n" for c in (*cases, *fields)))
    sys.stdout.write(document(cases, fields))


if __name__ == "__main__":
    main()
