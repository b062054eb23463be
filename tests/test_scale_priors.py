"""The tables of what estimated scales can do, against closed forms, and as they stand on the page."""

from __future__ import annotations

import numpy as np
import pytest
from scipy import stats

from tests.scale_priors import NOISE, PAGE, PRIORS, ROWS, chi_square, determined, half_width, held


@pytest.mark.parametrize(("count", "squares"), [(1, 0.3), (3, 3.0), (6, 54.0)])
def test_a_conjugate_prior_gives_students_distribution(count: int, squares: float) -> None:
    expected = stats.t.ppf(0.975, count + 2) * np.sqrt((2 + squares) / (count + 2))
    assert half_width(chi_square(2.0), count, squares) == pytest.approx(expected, rel=1e-4)


def test_known_noise_and_many_offsets_give_what_is_stated() -> None:
    assert held(PRIORS["within a factor of 2 (used)"], 500, (1.0, 3.0)) == pytest.approx([95.0, 95.0], abs=0.3)
    assert determined(5000, 1.5) == pytest.approx(95.0, abs=0.1)


def test_the_page_has_what_noise_of_a_wrong_sigma_gives() -> None:
    page = PAGE.read_text(encoding="utf-8")
    for n in ROWS:
        assert f"| {n} | " + " | ".join(f"{determined(n, f):.1f}" for f, _ in NOISE) + " |\n" in page
