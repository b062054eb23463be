"""Every sensor, alone and mixed, recovers planted errors and its own unknowns, with the right uncertainties."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.stats import chi2

from tests.in_ci import in_ci
from tests.sensor_campaigns import UNITS, Case, deviations, recovered
from tests.sensor_cases_mixed import MIXED
from tests.sensor_cases_planar import PLANAR
from tests.sensor_cases_spatial import SPATIAL

COVERED = ("grid_in_unknown_frame", "ballbar_unknown_ball_in_space", "tracker_ballbar_and_bench")
K95 = 1.96
CASES = {case.name: case for case in (*PLANAR, *SPATIAL, *MIXED)}


def check_fit(result: Mapping[str, Any]) -> None:
    """Converged, with a chi-square that noise alone explains."""
    dof = result["degrees_of_freedom"]
    low, high = chi2.ppf([0.0005, 0.9995], dof) / dof
    assert result["status"] == "converged" and low < result["chi2_per_dof"] < high
    assert all(0.6 < f < 1.6 for f in result["uncertainty"]["noise"].values())


def check_values(result: Mapping[str, Any], true: Mapping[str, float]) -> None:
    """Every determined parameter within four standard uncertainties, which are smaller than its range."""
    found = {p["name"]: p for p in result["parameters"]}
    off = deviations(result, true)
    assert {n: d for n, d in off.items() if not abs(d) < 4} == {}
    assert all(0 < found[n]["std_by_data"] < found[n]["range"] for n in off if found[n]["identified"])


def check_sums(result: Mapping[str, Any], true: Mapping[str, float]) -> None:
    """Sums of parameters that are determined where they are not apart."""
    unit = {p["name"]: UNITS[p["unit"]] for p in result["parameters"]}
    for held in result["undetermined"]:
        for total in held["determined"]:
            value = sum(c * true[n] / unit[n] for n, c in total["coefficients"].items())
            assert abs(total["value"] - value) < 4 * total["std"], total


QUICK = (
    "tracker_ballbar_and_bench", "other_instruments_next_day", "probe_calipers_joint_and_current", "line_touched",
    "tracker_three_reflectors_in_unknown_frame", "grid_moved_between_sessions", "wire_zero_and_scale_unknown",
    "tracker_noise_grows_and_is_correlated", "level", "angle_of_a_rod_with_unknown_zero", "ballbar_known_ball",
    "a_passive_drive_reads", "full_pose_in_space", "only_x",
)  # fmt: skip
"""Every kind of instrument, alone or beside others, with unknown frames, zeros and scales, in one session and two."""


@pytest.mark.parametrize("case", in_ci(QUICK, CASES.values(), lambda case: str(case.name)))
def test_planted_errors_come_back(case: Case, tmp_path: Path) -> None:
    result, true = recovered(case, 1, tmp_path)
    assert {p["name"] for p in result["parameters"]} == {*case.free, *case.nuisance}
    check_fit(result)
    check_values(result, true)
    check_sums(result, true)
    unknown = {p["name"] for p in result["parameters"] if p["std"] is None}
    assert not unknown & set(case.nuisance), "what belongs to the instrument is determined"
    assert len(unknown) < len(case.free)


@pytest.mark.slow
@pytest.mark.parametrize("name", COVERED)
def test_intervals_cover(name: str, tmp_path: Path) -> None:
    """Forty machines from the prior, forty noises: 95 % intervals hold 90 to 99 % of the true values.

    By the data alone: what is held is at its nominal value in these machines, so what its ranges add must not count.
    """
    case, inside, stated = CASES[name], [], []
    for seed in range(40):
        result, true = recovered(case, seed, tmp_path / str(seed))
        inside += [abs(d) <= K95 for d in deviations(result, true).values()]
        for p in result["parameters"]:
            if p["interval"] is not None:
                low, high = (end * UNITS[p["unit"]] for end in p["interval"])
                stated.append(low <= true[p["name"]] <= high)
    assert 0.90 <= np.mean(inside) <= 0.99, np.mean(inside)
    assert np.mean(stated) >= 0.90, np.mean(stated)
