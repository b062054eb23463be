"""What was predicted once is not searched again at the same numbers; at any others it is, and answers as it would."""

from __future__ import annotations

from dataclasses import replace
from itertools import permutations
from typing import Any

import cloudpickle
import numpy as np
import pytest

from pkmcal_cli.prediction import Request, Rows, predict, solving
from pkmcal_cli.prediction.rows import Sought
from tests.campaigns import shipped

ERROR = 2e-12
"""m or rad; in units of what is asked, by which the engine's Newton steps may differ."""


def task(machine: str) -> tuple[Any, Any, Any]:
    """A shipped machine, nominal values, and the rows of its table."""
    campaign = shipped(machine)
    return campaign.model, campaign.model.nominal, Rows.at(campaign.positions)


@pytest.fixture()
def searches(monkeypatch: pytest.MonkeyPatch) -> list[int]:
    """Told the number of rows of each search."""
    out: list[int] = []
    plain = solving._equilibrium

    def counted(model: Any, coefficients: Any, *others: Any) -> Any:
        out.append(len(coefficients))
        return plain(model, coefficients, *others)

    monkeypatch.setattr(solving, "_equilibrium", counted)
    return out


@pytest.mark.parametrize("machine", ["triglide", "hexapod7"])
def test_the_same_is_answered_at_once(machine: str, searches: list[int]) -> None:
    model, values, rows = task(machine)
    first = predict(model, values, rows)
    searches.clear()
    again = predict(model, values, rows, Request(parameters=model.names[:2]), first.start)
    some = np.array([7, 3, 20])
    part = predict(model, values, rows.take(some), None, first.start.take(some))
    assert searches == []
    assert (again.values == first.values).all() and (part.values == first.values[some]).all()


@pytest.mark.parametrize("step", [1e-12, 1e-6, 1e-3])
@pytest.mark.parametrize("what", ["parameter", "drive", "row"])
def test_whatever_changes_is_searched(what: str, step: float, searches: list[int]) -> None:
    """Also by a millionth of a micrometre: readings are those of a prediction that began anew."""
    model, values, rows = task("triglide")
    start = predict(model, values, rows).start
    values, shift = values.copy(), np.zeros_like(rows.readings)
    if what == "parameter":
        values[model.names.index("l1")] += step
    elif what == "drive":
        shift[11, 1] = step
    moved = rows.moved(shift)
    if what == "row":
        order = np.arange(len(rows))[::-1]
        moved = rows.take(order)
    searches.clear()
    warm = predict(model, values, moved, None, start)
    assert searches == [len(rows)]
    assert warm.values == pytest.approx(predict(model, values, moved).values, abs=ERROR)


def test_a_quick_answer_is_none_to_who_wants_all_poses_compared(searches: list[int]) -> None:
    model, values, rows = task("triglide")
    quick = predict(model, values, rows, Request(compare=False))
    assert quick.sought is None
    predict(model, values, rows, None, quick.start)
    assert len(searches) == 2


def test_another_model_is_asked_itself(searches: list[int]) -> None:
    """Whose noise explains more or less of what drives disagree by."""
    model, values, rows = task("triglide")
    start = predict(model, values, rows).start
    other = replace(model, channels=tuple(replace(c, sigma=10 * c.sigma) for c in model.channels))
    searches.clear()
    predict(other, values, rows, None, start)
    assert searches == [len(rows)]


def test_a_copy_from_another_process_is_not_asked_again(searches: list[int]) -> None:
    """Else fits that begin with what a worker found differ in their last bits from those of a single process."""
    model, values, rows = task("triglide")
    start = predict(model, values, rows).start
    copy, known = cloudpickle.loads(cloudpickle.dumps((model, start)))
    searches.clear()
    predict(copy, values, rows, None, start)
    predict(model, values, rows, None, known)
    assert searches == []


def test_a_small_number_beside_a_large_one_counts_and_so_does_an_exchange() -> None:
    """A length of 0.3 m beside a stiffness of 1e9 N/m, next to a zero of rounding; round numbers in another order."""
    plain = np.array([[1e9, 0.3, 1e-17, 2.0, 1.0, 0.5]])
    first = Sought.at(b"", plain)
    for column, step in ((1, 1e-16), (1, 1e-12), (0, 1e-6), (2, 1e-30)):
        moved = plain.copy()
        moved[0, column] += step
        assert first.answers(Sought.at(b"", moved)) == bool((moved == plain).all())
    orders = np.array(list(permutations((2.0, 1.0, 0.5, 4.0, 0.0, 3.0))))
    assert len(np.unique(Sought.at(b"", orders).marks)) == len(orders)
