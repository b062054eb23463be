"""Tables that lie never end `converged` with exit 0; honest ones are never implausible. All of them:
`python -m tests.hostile.campaigns`."""

from __future__ import annotations

import pytest

from tests.hostile.campaigns.honest import HONEST, Honest
from tests.hostile.campaigns.listed import LIES, UNTELLABLE, Lie
from tests.hostile.campaigns.run import ended, told
from tests.in_ci import in_ci

FAST = (
    "constant, gantry",
    "filled down, delta4",
    "inches from the middle on, triglide",
    "drives swapped from the middle on, scissors",
    "set up anew, turned by 0.05 deg, triglide",
    "other tool from the middle on, biglide",
    "scale 1.001, delta4",
    "two rows exchanged, triglide-nonredundant",
    "shuffled, biglide",
    "missing cells as 0, triglide",
    "metres, delta-printer",
    "angle reversed, five-bar",
    "commanded places as readings, biglide",
    "column of sigma in um for mm, triglide",
    "two machines in one call, triglide",
)
BY_NAME = {lie.name: lie for lie in LIES}


def test_there_are_enough_of_them() -> None:
    assert len(BY_NAME) == len(LIES) >= 60 and len({lie.machine for lie in LIES}) >= 5 and len(HONEST) >= 60


@pytest.mark.parametrize("name", FAST)
def test_some_that_lie(name: str) -> None:
    end = told(BY_NAME[name])
    assert end.status in BY_NAME[name].expected and (end.code != 0 or end.status == "incomplete"), end


@pytest.mark.parametrize("name", in_ci(["angle reversed, five-bar"], ["constant, gantry", "angle reversed, five-bar"]))
def test_a_hint_settles_that_calibrate_fails(name: str) -> None:
    """So that the others need not be fitted."""
    end = told(BY_NAME[name], whole=True)
    assert end.code in (1, 3) and end.status in BY_NAME[name].expected, end


def test_sound_tables_do_not_come_with_a_hint_of_a_change() -> None:
    """One per machine, of the largest errors and noise that are honest."""
    for honest in HONEST[11::12]:
        end = ended(honest.machine, (honest.table(),))
        assert end.code == 0 and end.status in ("converged", "incomplete"), (honest.name, end)


@pytest.mark.slow
@pytest.mark.parametrize("lie", LIES, ids=lambda lie: lie.name)
def test_none_is_believed(lie: Lie) -> None:
    end = told(lie)
    assert end.status != "converged" and (end.code != 0 or end.status == "incomplete"), end


@pytest.mark.slow
@pytest.mark.parametrize("honest", HONEST, ids=lambda h: h.name)
def test_no_honest_table_is_implausible(honest: Honest) -> None:
    assert ended(honest.machine, (honest.table(),)).code == 0


@pytest.mark.slow
@pytest.mark.parametrize("lie", [lie for lie, _ in UNTELLABLE], ids=lambda lie: lie.name)
def test_what_cannot_be_told_leaves_no_more_than_noise(lie: Lie) -> None:
    """Else it would belong to the others."""
    assert told(lie).status == "converged"
