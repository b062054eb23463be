"""What is left of the residual: at nominal parameters, after calibration, with one effect after the other."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from pkmcal_cli.base.rotation import Array
from pkmcal_cli.calibration.fit import Fit
from pkmcal_cli.calibration.problem import Problem
from pkmcal_cli.calibration.residual import linearise_at
from pkmcal_cli.diagnosis.refits import refit
from pkmcal_cli.diagnosis.run_diagnosis import Diagnosis


@dataclass(frozen=True)
class Share:
    """One step of the waterfall: what was added, and chi-square and degrees of freedom that are left."""

    name: str
    chi2: float
    dof: int

    @property
    def noise(self) -> float:
        """How many times the stated noise the residuals are."""
        return float(np.sqrt(self.chi2 / self.dof))


def waterfall(diagnosis: Diagnosis) -> list[Share]:
    """Root of chi-square per degree of freedom: nominal, calibrated, with one effect after the other.

    Displacements without a name belong to all effects together: with one, these are the last step.
    """
    problem, search = diagnosis.problem, diagnosis.search
    nominal = Share("nominal", _chi2(problem, problem.model.nominal), problem.count)
    out = [nominal, _share("calibrated", diagnosis.before)]
    names = [f.hypothesis.name for f in diagnosis.findings]
    if diagnosis.shapes:
        together = ", ".join([*names, *(s.hypothesis.name for s in diagnosis.shapes)])
        return [*out, _share(f"+ {together}", search.fit)]
    for k in range(1, len(names)):
        part = refit(replace(search, accepted=tuple(f.hypothesis for f in diagnosis.findings[:k])), {})
        if part is not None:
            out.append(_share(f"+ {names[k - 1]}", part))
    return [*out, _share(f"+ {names[-1]}", search.fit)] if names else out


def _share(name: str, fit: Fit) -> Share:
    return Share(name, fit.chi2, max(fit.dof, 1))


def _chi2(problem: Problem, values: Array) -> float:
    """With the drives' errors as part of the noise, as in a fit."""
    return float((linearise_at(problem, values, (), None).values[0] ** 2).sum())
