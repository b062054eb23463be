"""Rows of docs/verification.md about calibration: (name, required, measured), for `tests.verification`.

Coverage and figure 12 take long: their rows repeat what docs/coverage.md and docs/figure12.csv, which commands write,
have measured.
"""

from __future__ import annotations

import csv
from pathlib import Path

import numpy as np

from pkmcal_cli.calibration.fit import Fit
from pkmcal_cli.calibration.identifiability import combinations
from pkmcal_cli.calibration.identify import identify
from pkmcal_cli.calibration.problem import Problem
from pkmcal_cli.model.model import Model
from pkmcal_cli.prediction.inverse_kinematics import drive_positions
from pkmcal_cli.report.parameters import determined_sums
from tests import hangprinter_cases
from tests.campaigns import by_engine, planted, shipped
from tests.hangprinter_cases import ANCHORS, LINES, RADII, RMS, SESSIONS, calibrated, disagreement, held_out
from tests.support import model
from tests.test_identifiability import delta_problem, measured
from tests.truth.machines import PINNED
from tests.verification_row import Row

DOCS = Path(__file__).resolve().parents[1] / "docs"


def recovered() -> list[Row]:
    """Planted parameters of the shipped files, from their readings without noise."""
    rows: list[Row] = []
    for name in (*PINNED, "hexapod7"):
        plan, _, errors = planted(name)
        text = f"{name}: {len(plan.selected)} planted parameters without noise, largest error in ranges"
        rows.append(Row(text, "< 1e-6", float(np.abs(errors).max())))
    return rows


def covered() -> list[Row]:
    """500 campaigns, from docs/coverage.md."""
    rows: list[Row] = []
    for line in (DOCS / "coverage.md").read_text(encoding="utf-8").splitlines():
        cells = [c.strip() for c in line.strip("|").split("|")]
        if len(cells) == 8 and cells[2].isdigit():
            text = f"{cells[0]}: 500 campaigns with noise (docs/coverage.md), {cells[2]} parameters"
            rows += [
                Row(f"{text}, 95 % intervals that contain the true value, average, %", "94 to 96", cells[3]),
                Row(f"{text}, the same for the worst parameter, %", "> 91", cells[4]),
                Row(f"{text}, chi-square per degree of freedom", "1 +- 0.02", float(cells[5])),
            ]
    return rows


def _undetermined(text: str, named: str, machine: Model, fit: Fit, true: dict[str, float]) -> list[Row]:
    """Rows of one fit: that `named` is named and does not move, that its sums are right. `true`: SI, of errors."""
    null = [c for c in combinations(fit.directions) if c.kind == "null"]
    index = [machine.names.index(n) for n in fit.selected]
    moved = (fit.values - machine.nominal)[index] / machine.ranges[index]
    scores = []
    for combination in null:
        for coefficients, value, std, _ in determined_sums(machine, combination, fit):
            planted_sum = sum(
                c * (machine.nominal[machine.names.index(n)] + true.get(n, 0.0)) for n, c in coefficients.items()
            )
            scores.append(abs(value * 1e-3 - planted_sum) / (std * 1e-3))
    names = "; ".join(sorted(", ".join(sorted(c.names)) for c in null))
    members = sorted({n for c in null for n in c.names})
    infinite = sorted(n for n, s in zip(fit.selected, fit.std, strict=True) if np.isnan(s))
    along = np.abs(fit.directions.vectors[fit.directions.null] @ moved).max()
    return [
        Row(f"{text}: combinations reported as not determined", f"`{named}`", names),
        Row(f"{text}: parameters with `std: null`", f"`{', '.join(members)}`", ", ".join(infinite)),
        Row(f"{text}: movement along them, in ranges", "< 1e-5", float(along)),
        Row(f"{text}: determined sums, largest error in standard uncertainties", "< 3", float(max(scores))),
    ]


def undetermined() -> list[Row]:
    """Delta with heights only; Triglide with a rod's length and its joint at one pose."""
    errors = {"R1": 4e-4, "r2": -3e-4, "l3": 5e-4}
    machine, problem = delta_problem(errors, noise=2)
    fit = identify(problem, tuple(n for n in machine.names if n[0] != "g"))
    rows = _undetermined("linear delta, heights only", "R1, r1; R2, r2; R3, r3", machine, fit, errors)
    errors = {"l1": 4e-5, "xb1r": -7e-5}
    for name in ("triglide", "triglide-nonredundant"):
        machine = model(name)
        q = drive_positions(machine, np.array([[0.36, 0.275, 0, 0, 0, 0]])).readings
        fit = identify(measured(machine, q, errors, noise=1), ("l1", "xb1r"))
        rows += _undetermined(f"{name}, l1 and xb1r at one pose", "l1, xb1r", machine, fit, errors)
    return rows


def hangprinter() -> list[Row]:
    """Both sessions, whichever three drives are inputs."""
    rows: list[Row] = []
    names = {ANCHORS: "12 anchor coordinates", RADII: "anchors and two radii"}
    for (session, selection), rms in RMS.items():
        text = f"hangprinter {session}, {names[selection]}"
        for line in LINES:
            inputs = ", ".join(sorted(set(LINES) - {line}))
            found = calibrated(session, line, selection).after
            rows.append(Row(f"{text}, inputs {inputs}: line-length rms, mm", f"{rms} (3 %)", found))
        held, _ = held_out(session, "D", selection)
        rows.append(Row(f"{text}: line-length rms held out in six folds, mm", "shown", held))
        rows.append(
            Row(f"{text}: choices of inputs, largest difference in standard uncertainties", "< 0.1",
             disagreement(session, selection))
        )  # fmt: skip
    return rows


def figure_12() -> list[Row]:
    """From docs/figure12.csv."""
    with (DOCS / "figure12.csv").open(encoding="utf-8") as file:
        table = {(r["machine"], int(r["points"])): r for r in csv.DictReader(file)}
    rows: list[Row] = []
    for kind, column in (("parameters", "length"), ("tool point", "tool")):
        for points in (10, 40, 226):
            redundant, plain = (table[m, points] for m in ("triglide", "triglide-nonredundant"))
            values = [float(r[f"{column} [um]"]) for r in (redundant, plain)]
            text = f"figure 12, {redundant['n']} repetitions of {points} points, mean error of the {kind}: "
            rows.append(Row(f"{text}redundant ({values[0]:.2f} um) over non-redundant", "> 1", values[0] / values[1]))
    return rows


def held_out_noise() -> list[Row]:
    """Held-out error of noise against the linear model's."""
    from tests.test_holdout import noise_against_theory

    found = noise_against_theory()
    text = "held-out error due to noise over"
    return [
        Row(f"{text} the linear model's prediction", f"1 +- {found.scatter:.2f}", found.over_theory),
        Row(f"{text} sigma sqrt(1 + p/n)", "shown", found.over_thumb),
    ]


def far_starts() -> list[Row]:
    """The hangprinter's anchors 300 mm off in random directions."""
    ratio = 0.0
    for session in SESSIONS:
        problem, _ = hangprinter_cases.measured(session)
        best = calibrated(session, "D", RADII).fit
        for seed in range(4):
            fit = identify(problem, best.selected, off_by(problem, seed))
            ratio = max(ratio, fit.chi2 / best.chi2 if fit.status == "converged" else np.inf)
    text = "hangprinter from anchors 300 mm off, 4 starts per session: largest chi-square over the minimum"
    return [Row(text, "< 1.000001", ratio)]


def off_by(problem: Problem, seed: int) -> np.ndarray:  # type: ignore[type-arg]
    """Nominal values with every anchor 300 mm off in a random direction."""
    way = np.random.default_rng(seed).normal(size=(4, 3))
    start = problem.model.nominal
    start[:12] += (0.3 * way / np.linalg.norm(way, axis=1)[:, None]).ravel()
    return start


def weak_held() -> list[Row]:
    """The redundant Triglide's weak combinations."""
    plan, rng = by_engine(shipped("triglide")), np.random.default_rng(0)
    fit = identify(plan.measured(plan.drawn(rng), rng), plan.selected)
    moved = (fit.values - plan.model.nominal)[plan.index] / plan.ranges
    along = np.abs(fit.directions.vectors[fit.directions.weak] @ moved).max()
    text = f"triglide at 10 um, {int(fit.directions.weak.sum())} weak combinations: movement along them, in ranges"
    return [Row(text, "< 0.01", float(along))]


PARTS = [recovered, covered, undetermined, weak_held, hangprinter, far_starts, figure_12, held_out_noise]
"""Parts of the table in order."""
