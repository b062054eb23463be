"""Judging one diagnosis by fixed rules; the rules stand in `RULES`, which the document shows."""

from __future__ import annotations

import time
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from pkmcal_cli.diagnosis.findings import Finding
from pkmcal_cli.diagnosis.run_diagnosis import Diagnosis
from pkmcal_cli.diagnosis.shape_findings import ShapeFinding
from tests.benchmark.baselines import baselines
from tests.benchmark.cases import Case
from tests.benchmark.draw import joint_sizes
from tests.benchmark.followup import again
from tests.benchmark.heldout import held_out
from tests.benchmark.names import covered, in_set, is_residue, names_of
from tests.benchmark.setting import Setting, diagnosed

RULES = """
- **exact**: every planted effect is found at its place (or as the held parameter of which it is another name), with no
  other finding, nothing unknown and no bad row. A group of places with values of their own names all of them, if an
  effect was planted at each; else it is another name. A further finding counts as a *shape residue*, not as an extra,
  if it enters at the same place as a planted effect, in the same way (drive, guide, carriage, length), and needs the
  same columns. The simulator's effects differ from the catalogue's shapes by 10 to 25 %.
  Effects that are named with a shape of their own count as found.
- **in set**: the planted effect is in the 95 % credible set of a finding.
- **wrong element**: a finding is the planted keyword at another place, its credible set has one member, and the true
  effect is not found.
- **missed**: nothing is reported. **doubt**: all planted effects are found, but something unknown is also reported.
  **extra**: another effect is also found. **rows**: good rows are also reported as bad.
- **unknown**: no effect is named, and something unknown is reported. **set**: another effect is named first, and the
  true one is in the credible set of a finding. **same place**: another effect with the same place and entry is named.
  **wrong**: any other effect is named. **missed one**: only some of several effects are found. **named**: an effect is
  named although none of the catalogue was planted.
- **separable**: no other hypothesis of the engine has a cosine above 0.95 with the change that the planted effect makes
  to the readings, nor with the part of this change that the effect's own hypothesis explains; declared parameters are
  projected out. (The second condition is needed because the simulator's own shapes lower all cosines; without it, two
  hypotheses with exactly the same action would count as separable.)
- Sizes are in units of the minimal detectable size (MDB): the effect's change of the true readings in stated standard
  deviations, declared parameters projected out, divided by sqrt(17.07). If several effects are planted, each is between
  2 and 8 MDB alone, separable, at a place of its own, and at least 1.5 MDB with the others projected out. The size of
  an unknown effect is its rms divided by the stated noise.
- **single wrong name** (missing columns): an effect of the machine is named whose credible set has one member and lacks
  the true effect, and nothing is reported as unknown.
- **held-out error**: rms against the true readings of a second campaign on the same day, with other poses and times.
"""


@dataclass(frozen=True, kw_only=True)
class Result:
    """What became of a case; plain values, one line of JSON. `errors`: (estimate - planted) / std of parameters."""

    test: str
    number: int
    machine: str
    seed: int
    planted: list[dict[str, Any]]
    found: list[dict[str, Any]]
    unknown: list[tuple[str, float, str]]
    bad_rows: list[int]
    verdict: str
    outcome: str
    in_set: bool
    seconds: float
    discrepancies: int = 0
    size: float = 0.0
    rows: Mapping[str, int] = field(default_factory=dict)
    errors: Mapping[str, float] = field(default_factory=dict)
    held_out: Mapping[str, float] = field(default_factory=dict)
    others: Mapping[str, bool] = field(default_factory=dict)  # whether simpler ways are exact
    apart: float = 0.0  # size of what tells the members of a set apart, with further points; 0: none were measured
    predicted: float = 0.0  # the same as the first campaign's estimates predict
    points: int = 0  # how many further points
    solved: bool = False  # whether the diagnosis with these is exact, a set of one


def judged(case: Case) -> Result:
    """Diagnoses a case and judges what was found."""
    measured = case.measured()
    start = time.process_time()
    try:
        d = diagnosed(measured, case.seed)
    except Exception as error:  # a crash is a result too
        return _crashed(case, repr(error))
    seconds = time.process_time() - start
    outcome, discrepancies = outcome_of(case, d)
    whole = outcome == "exact" and bool(case.drawn)
    head = _head(case)
    if case.drawn and not whole and not case.scenario.omit:
        head["planted"] = [p | {"calibrated": c} for p, c in zip(head["planted"], calibrated(case, d), strict=True)]
    bad = set(np.nonzero(measured.outlier)[0])
    called = set(d.bad_rows)
    rows = {"bad": len(bad), "found": len(bad & called), "good": len(measured.outlier) - len(bad)}
    return Result(
        **head,
        found=[*map(_finding, d.findings), *map(_shape, d.named_shapes)],
        unknown=[(u.depends_on, float(u.p_value), u.hint) for u in d.unknown],
        bad_rows=sorted(called),
        verdict=d.verdict,
        outcome=outcome,
        in_set=bool(case.drawn) and all(in_set(x, d, truths_of(case)) for x in case.drawn),
        seconds=seconds,
        discrepancies=discrepancies,
        rows=rows | {"lost": len(called - bad)},
        errors=errors_of(case, d) if whole else {},
        held_out=held_out(case, d) if whole else {},
        others=others(case, d) if case.test in ("nothing", "single") else {},
        **(_followed(case, d) if case.test == "alias" else {}),
    )


def _followed(case: Case, d: Diagnosis) -> dict[str, Any]:
    """What further points make of a set that holds the truth."""
    if not (d.findings and d.findings[0].ambiguous and in_set(case.drawn[0], d, truths_of(case))):
        return {}
    then = again(case, d)
    whole = outcome_of(case, then.diagnosis)[0] == "exact"
    solved = whole and not then.diagnosis.findings[0].ambiguous
    return {"apart": then.apart, "predicted": then.predicted, "points": then.points, "solved": solved}


def _head(case: Case) -> dict[str, Any]:
    """What the case is."""
    sizes = [d.size for d in case.drawn]
    if len(case.drawn) > 1:
        sizes = joint_sizes(Setting.of(case.machine, case.seed), case.drawn)
    planted = [
        {"name": d.name, "values": dict(d.planted.values), "size": d.size, "joint": s}
        | {"own": d.own, "rival": d.rival, "cosine": d.cosine, "separable": d.separable}
        for d, s in zip(case.drawn, sizes, strict=True)
    ]
    if case.unknown is not None:
        planted.append({"name": f"{case.unknown.keyword}@{case.unknown.at}", "values": dict(case.unknown.values)})
    head = {"test": case.test, "number": case.number, "machine": case.machine, "seed": case.seed}
    return head | {"planted": planted, "size": case.size}


def calibrated(case: Case, d: Diagnosis) -> list[float]:
    """Cosine of what each effect does with its hypothesis where the calibration without it ends: where forces decide,
    as in clearances, the hypothesis is another there."""
    there = Setting(Setting.of(case.machine, case.seed).plain, d.before.values)
    return [there.cosine(there.change(x.planted), x.name) for x in case.drawn]


def _crashed(case: Case, why: str) -> Result:
    """A case whose diagnosis raised."""
    rest: dict[str, Any] = {"found": [], "unknown": [], "bad_rows": [], "in_set": False, "seconds": 0.0}
    return Result(**_head(case), **rest, verdict=why, outcome="crash")


def _finding(f: Finding) -> dict[str, Any]:
    """A finding in plain values."""
    sizes = zip(f.hypothesis.parameters, f.estimate, f.std, strict=True)
    return {
        "name": f.hypothesis.name,
        "parameters": {n: (v, s) for n, v, s in sizes},
        "evidence": f.evidence,
        "set": [(r.hypothesis.name, r.weight) for r in f.rivals],
        "measurement": f.hypothesis.measurement,
        "beyond": f.beyond,
        "provisional": f.provisional,
        "confirmed": f.held_out.confirmed,
    }


def _shape(s: ShapeFinding) -> dict[str, Any]:
    """A named effect with a shape of its own; it has no parameters."""
    assert s.named is not None
    sets = [(f"{s.named.effect}@{at}", weight) for at, weight in s.places]
    kinds = {"measurement": False, "beyond": False, "provisional": False, "confirmed": s.held_out.confirmed}
    return {"name": s.named.name, "parameters": {}, "evidence": s.evidence, "set": sets, "own_shape": True} | kinds


def outcome_of(case: Case, d: Diagnosis) -> tuple[str, int]:
    """The outcome in a word, and how many findings are shape model discrepancies."""
    named = named_by(case, d)
    hits = [x for x in case.drawn if names_of(x, d) & set(named)]
    hit_names = {n for x in hits for n in names_of(x, d)}
    discrepancies = [n for n in named if n not in hit_names and any(is_residue(n, x) for x in hits)]
    extras = [n for n in named if n not in hit_names and n not in discrepancies]
    if not (named or d.unknown or (d.bad_rows and not case.scenario.outliers)):
        return ("missed" if case.planted else "exact"), 0
    if case.drawn and len(hits) == len(case.drawn):
        word = "extra" if extras else "doubt" if d.unknown else "rows" if d.bad_rows else "exact"
        return word, len(discrepancies)
    if not named:
        return ("unknown" if d.unknown else "rows"), 0
    return (_misnamed(case, d) if case.drawn else "named"), len(discrepancies)


def truths_of(case: Case) -> set[str]:
    """Names of the planted effects."""
    return {x.name for x in case.drawn}


def named_by(case: Case, d: Diagnosis) -> list[str]:
    """What the findings name; a group with values of its own names its members, if all of them were planted."""
    found = [n for f in d.findings for n in sorted(covered(f.hypothesis, truths_of(case)))]
    return [*found, *(s.named.name for s in d.named_shapes if s.named is not None)]


def _misnamed(case: Case, d: Diagnosis) -> str:
    """What is wrong with names of which not all are right."""
    truths = truths_of(case)
    missing = [x for x in case.drawn if not names_of(x, d) & set(named_by(case, d))]
    lone = [f.hypothesis.name.partition("@") for f in d.findings if not f.ambiguous]
    if all(in_set(x, d, truths) for x in missing):
        return "set"
    if any(k == x.planted.keyword and f"{k}@{at}" not in truths for x in missing for k, _, at in lone):
        return "wrong element"
    if any(is_residue(f.hypothesis.name, x) for f in d.findings for x in missing):
        return "same place"
    return "missed one" if len(missing) < len(case.drawn) else "wrong"


def others(case: Case, d: Diagnosis) -> dict[str, bool]:
    """Whether simpler ways name exactly what was planted; correlation always names one."""
    exact = {}
    for way, named in baselines(d).items():
        right = [n for n in named if any(n in names_of(x, d) for x in case.drawn)]
        rest = [n for n in named if n not in right and not any(is_residue(n, x) for x in case.drawn)]
        exact[way] = bool(right) == bool(case.drawn) and not rest
    return exact


def errors_of(case: Case, d: Diagnosis) -> dict[str, float]:
    """(estimate - planted) / std of the planted parameters that are determined."""
    out = {}
    for drawn in case.drawn:
        for f in d.findings:
            for name, value, std in zip(f.hypothesis.parameters, f.estimate, f.std, strict=True):
                effect, _, short = name.rpartition(".")
                if effect == drawn.name and short in drawn.planted.values and np.isfinite(std) and std > 0:
                    out[name] = (value - drawn.planted.values[short]) / std
    return out
