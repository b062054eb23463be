"""Anchors of machines that measure themselves, on readings of an independent simulator, and on real ones."""

from __future__ import annotations

import re

import numpy as np
import pytest

from tests import hangprinter_alone as real
from tests.in_ci import in_ci
from tests.self_calibration_cases import CASES, OTHERS, SEEDS, calibrated, disagreement, summary
from tests.self_calibration_page import PAGE, renewed

LOST = (("drums", 9), ("heavy", 11))
"""Cases and seeds in which a row cannot be predicted at the drawing."""


@pytest.mark.parametrize("name", in_ci(["camera", "table", "router", "drums", "tower"], CASES))
def test_anchors_are_found(name: str) -> None:
    """To four standard uncertainties (0.05 % of all that are fitted for 90 coordinates have more); chi-square as noise
    makes it, within four of its standard deviations (there are 40 degrees of freedom and more)."""
    case = CASES[name]
    found = calibrated(case, 0)
    assert found.status == "converged"
    assert np.abs(found.scores(case)).max() < 4
    assert len(found.anchors(case)) == len(case.anchors) * len(case.axes) - len(held(name))
    assert found.chi2_per_dof == pytest.approx(1, abs=4 * np.sqrt(2 / 40))


def held(name: str) -> tuple[str, ...]:
    """What is held of the datum that the case declares."""
    return {"heavy": ("Ax",)}.get(name, CASES[name].datum)


@pytest.mark.parametrize(
    ("name", "other"),
    [
        pytest.param(name, other, id=f"{name}-{other}", marks=[pytest.mark.slow] if k else [])
        for name, others in OTHERS.items()
        for k, other in enumerate(others)
    ],
)
def test_the_choice_of_inputs_does_not_matter(name: str, other: dict[str, float]) -> None:
    """To first order: 5 % of a standard uncertainty are left for what a known error of the drawing bends."""
    assert disagreement(name, 0, other) < 0.05


@pytest.mark.parametrize(("name", "seed"), LOST)
def test_the_datum_is_held_though_a_row_fails_at_the_drawing(name: str, seed: int) -> None:
    case = CASES[name]
    assert np.isfinite(calibrated(case, seed).scores(case)).all()


@pytest.mark.slow
def test_twenty_seeds_of_every_case() -> None:
    """99 % of the coordinates are within three standard uncertainties."""
    every = {name: summary(case, range(SEEDS)) for name, case in CASES.items()}
    scores = np.concatenate([s.scores for s in every.values()])
    assert all(s.converged == SEEDS for s in every.values())
    assert (np.abs(scores) <= 3).mean() >= 0.99
    for s in every.values():
        assert s.chi2_per_dof.mean() == pytest.approx(1, abs=4 * np.sqrt(2 / 40 / SEEDS))


def test_tables_are_put_between_their_markers() -> None:
    page = "a\n<!-- few -->\nold\n<!-- end -->\nb\n<!-- cases -->\n<!-- end -->\n"
    assert renewed(page, {"few": "new\n"}) == page.replace("old", "new")


# the real machine -----------------------------------------------------------------------------------------------------


@pytest.mark.slow
def test_motors_alone_find_what_the_camera_finds() -> None:
    """Within three standard uncertainties, and as the page says above one: the machine has errors of other kinds."""
    score = list[float]()
    for session in real.SESSIONS:
        result = real.alone(session)
        assert result["status"] == "converged" and tuple(result["datum"]) == real.DATUM
        score += [round(abs(row[-1]), 1) for row in real.apart(session).values()]
    page = PAGE.read_text(encoding="utf-8")
    stated = re.search(r"(\w+) of the (\d+) are above 1.0,\s+the largest is ([\d.]+):", page)
    assert stated is not None and max(score) < 3
    assert (len(score), max(score)) == (int(stated[2]), float(stated[3]))
    assert stated[1] == ("Nine", "Ten", "Eleven")[sum(s > 1.0 for s in score) - 9]


@pytest.mark.slow
def test_nine_known_positions_predict_the_other_thirty_two() -> None:
    """6.1 mm; eight positions do so within 20 %, whichever they are."""
    known, rms, good = real.withheld(0)
    assert known == 9
    assert good < rms <= 6.1
    assert max(real.withheld(first)[1] for first in range(1, 5)) < 1.2 * 6.1


@pytest.mark.slow
def test_the_bad_row_is_the_first_outlier() -> None:
    outliers = real.by_camera(real.SESSIONS[1], "tukey")["outliers"]
    assert outliers[0]["line"] == real.BAD_LINE
    assert abs(outliers[0]["deviation"]) > 1.5 * abs(outliers[1]["deviation"])
