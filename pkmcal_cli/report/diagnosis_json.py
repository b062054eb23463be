"""The result of `diagnose` as JSON."""

from __future__ import annotations

from typing import Any

import numpy as np

from pkmcal_cli.diagnosis.findings import Finding
from pkmcal_cli.diagnosis.groups import POSE
from pkmcal_cli.diagnosis.hypotheses import RELEASE
from pkmcal_cli.diagnosis.noise_growth import NoiseGrowth
from pkmcal_cli.diagnosis.unknown import Unknown
from pkmcal_cli.diagnosis.visible_sizes import VisibleSizes
from pkmcal_cli.report.detectable_sizes import sizes_json
from pkmcal_cli.report.diagnosis_values import DiagnosisValues
from pkmcal_cli.report.number_format import finite
from pkmcal_cli.report.shape_text import ShapeText


class DiagnosisJson(DiagnosisValues):
    """One diagnosis as plain values; docs/json.md says what they are."""

    def whole(self) -> dict[str, Any]:
        """The JSON result."""
        diagnosis = self.diagnosis
        return {
            "verdict": diagnosis.verdict,
            "mistakes": list(diagnosis.mistakes),
            "implausible": list(diagnosis.implausible),
            "sigma": "estimated" if diagnosis.scale.variance != 1.0 else "stated",
            "sigma_factor": float(np.sqrt(diagnosis.scale.variance)),
            "noise_correlation": diagnosis.correlation,
            "noise_models": [_growth_json(n) for n in diagnosis.noise],
            "chi2_per_dof_before": finite(diagnosis.cleared.chi2_per_dof),
            "chi2_per_dof_after": finite(diagnosis.search.fit.chi2_per_dof),
            "p_value": finite(diagnosis.p_global),
            "kind": diagnosis.shown.name,
            "effects": [self._finding_json(f) for f in diagnosis.findings],
            "outliers": [self._row_json(row) for row in diagnosis.bad_rows],
            "bench": [reading.json() | {"used": False} for reading in self.bad_readings]
            + [reading.json() | {"used": True} for reading in self.suspected_readings],
            "suspected": [
                self._row_json(row) | {"p_value": finite(chance)} for row, chance in diagnosis.suspected.items()
            ],
            "down_weighted": [] if self.audit is None else self.audit.json(),
            **self.failed.json(),
            "unknown": [self._unknown_json(u) for u in diagnosis.unknown],
            "wrong_numbers": self.numbers.json(),
            "unexplained": [
                ShapeText(self.machine, self.shaped_model, s, self.error_unit).json() for s in diagnosis.shapes
            ],
            "not_testable": [{"effect": name, "needs": needs} for name, needs in diagnosis.not_testable],
            "detectable": [sizes_json(self.model, d) for d in diagnosis.detectable if d.tested],
            "invisible": [self._invisible_json(i) for i in diagnosis.invisible],
            "same_as": [
                {"effect": effect, "parameter": release.removeprefix(f"{RELEASE} ")}
                for effect, release in map(_effect_first, diagnosis.same.items())
                if release.startswith(RELEASE)
            ],
            "effective_tests": finite(diagnosis.search.tests),
            "seed": diagnosis.seed,
        }

    def _finding_json(self, finding: Finding) -> dict[str, Any]:
        h, unit = finding.hypothesis, self.error_unit
        return {
            "effect": h.effect,
            "at": h.at,
            "parameters": [self._parameter_json(finding, k) for k in range(len(h.parameters))],
            "evidence": finite(finding.evidence),
            "p_value": finite(finding.p_value),
            "share": finite(finding.share),
            "credible_set": [
                {"effect": r.hypothesis.effect, "at": r.hypothesis.at, "weight": r.weight, "cosine": r.cosine}
                for r in finding.rivals
            ],
            "runner_up": self._runner_up_json(finding),
            "heldout_rms": finite(finding.held_out.with_it / unit.scale),
            "heldout_rms_without": finite(finding.held_out.without / unit.scale),
            "unit": unit.text,
            "confirmed": finding.held_out.confirmed,
            "stable": finite(finding.stable.share),
            "otherwise": [{"effect": h.effect, "at": h.at, "share": share} for h, share in finding.stable.others],
            "likelihood_ratio_over_score": finite(finding.nonlinear),
            "provisional": finding.provisional,
            "selection": self._selection_json(finding),
            "far_off": None
            if finding.run_away is None
            else {name: off / self.unit(name).scale for name, off in finding.run_away.items()},
        }

    def _runner_up_json(self, finding: Finding) -> dict[str, Any] | None:
        """The best hypothesis outside the credible set."""
        best = finding.runner_up
        if best is None:
            return None
        return {"effect": best.hypothesis.effect, "at": best.hypothesis.at, "log_odds": finite(best.log_odds)}

    def _selection_json(self, finding: Finding) -> dict[str, Any] | None:
        """What being found made of its size."""
        chosen = finding.selected
        return None if chosen is None else {"factor": chosen.factor, "low": chosen.low, "high": chosen.high}

    def _parameter_json(self, finding: Finding, k: int) -> dict[str, Any]:
        name = finding.hypothesis.parameters[k]
        unit = self.unit(name)
        scale = unit.scale
        value = unit.from_si(finding.estimate[k])
        return {"name": name, "value": finite(value), "std": finite(finding.std[k] / scale), "unit": unit.text}

    def _row_json(self, row: int) -> dict[str, Any]:
        m = self.measured
        return {"file": m.files[m.file_index[row]], "line": int(m.line[row]), "id": m.ids[row] or None}

    def _unknown_json(self, unknown: Unknown) -> dict[str, Any]:
        unit = self.error_unit
        size = unknown.rms * self.sigma / unit.scale
        return {
            "depends_on": unknown.depends_on,
            "rms": finite(size),
            "unit": unit.text,
            "p_value": finite(unknown.p_value),
            "hint": unknown.hint or None,
            "largest": self._largest_json() if unknown.depends_on == POSE else None,
        }

    def _largest_json(self) -> dict[str, Any] | None:
        """Where a smooth map of what is unknown is largest."""
        field, unit = self.field, self.length_unit
        if field is None:
            return None
        at = {c: finite(v / unit.scale) for c, v in zip("xyz", field.at[field.largest])}
        size = finite(float(np.linalg.norm(field.vectors[field.largest])) / unit.scale)
        return at | {"size": size, "unit": unit.text, "explained": finite(field.explained)}

    def _invisible_json(self, hidden: VisibleSizes) -> dict[str, Any]:
        return sizes_json(self.model, hidden) | {
            "plausible": finite(hidden.plausible / self.unit(hidden.parameter).scale),
            "absorbed_by": list(hidden.absorbed_by),
            "rows_needed": self.rows_needed(hidden),
        }


def _growth_json(noise: NoiseGrowth) -> dict[str, Any]:
    return {
        "effect": "noise_model",
        "at": noise.sensor,
        "towards": noise.towards,
        "ratio": finite(noise.ratio),
        "ratio_std": finite(noise.ratio_std),
        "slope": finite(noise.slope * 1e6),
        "std": finite(noise.slope_std * 1e6),
        "unit": "um/m",
        "p_value": finite(noise.p_value),
    }


def _effect_first(names: tuple[str, str]) -> tuple[str, str]:
    """An effect and a parameter that are the same, whichever stands for the other."""
    one, other = names
    return (other, one) if one.startswith(RELEASE) else (one, other)
