"""NIST StRD nonlinear regressions through the fit itself; the certified values are the truth."""

from __future__ import annotations

import numpy as np
import pytest

from tests.hostile.nist import run
from tests.hostile.nist_models import FORMULAS, DataSet


@pytest.mark.parametrize("name", FORMULAS)
def test_formulas_and_files_are_those_of_nist(name: str) -> None:
    """Certified sum of squares and standard deviations, from certified values and the data as they are read."""
    data = DataSet.read(name)
    predicted, jacobian = data.predicted(data.certified)
    if name != "Lanczos1":  # its sum, 1e-25, is lost in the rounding of the certified values
        assert ((data.y - predicted) ** 2).sum() == pytest.approx(data.squares, rel=1e-8)
    std = data.deviation * np.sqrt(np.diag(np.linalg.inv(jacobian.T @ jacobian)))
    np.testing.assert_allclose(std, data.uncertainty, rtol=1e-6)


def test_fifty_of_fifty_four_runs_have_four_digits_and_the_others_say_so() -> None:
    runs = [run(name, start) for name in FORMULAS for start in (0, 1)]
    assert len(runs) == 54
    assert sum(r.right for r in runs) >= 50, [(r.name, r.start, r.digits) for r in runs if not r.right]
    assert all(r.honest for r in runs), [(r.name, r.start) for r in runs if not r.honest]
