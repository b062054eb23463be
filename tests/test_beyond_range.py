"""An effect far beyond its range: a table so coarse that nothing within the range shows. Simulated independently."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from pkmcal_cli.diagnosis.closed_loop import improve
from pkmcal_cli.diagnosis.findings import Finding
from pkmcal_cli.diagnosis.run_diagnosis import diagnose
from tests.benchmark.setting import ALPHA, Ready, ready
from tests.truth.campaigns import Campaign, Planted, campaign

MACHINE, PLACE, PARAMETER = "triglide-nonredundant", "q1", "backlash@q1.b"
PITCH, PITCH_PARAMETERS = {"c": 0.36e-3, "s": -0.03e-3, "period": 0.01}, ("pitch@q1.c", "pitch@q1.s")  # m
COARSE = 30.0  # times the noise of the usual campaign
SIZE = 0.36e-3  # m, of a range of 0.06 mm
SEED = 1
WIDER = 20.0


@cache
def coarse(keyword: str = "backlash") -> tuple[Campaign, Ready]:
    """A campaign with coarse readings and as coarse a statement of their noise."""
    values = {"backlash": {"b": SIZE}, "pitch": PITCH}[keyword]
    measured = campaign(MACHINE, [Planted(keyword, PLACE, values)], SEED)
    noise = COARSE * (measured.readings - measured.true_readings)
    measured = replace(measured, readings=measured.true_readings + noise, sigma=COARSE * measured.sigma)
    table = ready(measured)
    return measured, replace(table, problem=replace(table.problem, sigma=COARSE * table.problem.sigma))


def std_alone() -> float:
    """Standard uncertainty of the backlash, m, if nothing else were unknown: by the simulator's own readings."""
    measured, _ = coarse()
    without = campaign(MACHINE, [], SEED)
    moved = (measured.true_readings - without.true_readings) / measured.sigma
    return SIZE / float(np.sqrt((moved**2).sum()))


def found(table: Ready) -> Finding:
    """The only finding of a diagnosis."""
    diagnosis = diagnose(table.candidates, table.problem, table.selected, ALPHA, SEED)
    (finding,) = diagnosis.findings
    return finding


@cache
def found_as_it_is(keyword: str) -> Finding:
    """That of the campaign with coarse readings."""
    return found(coarse(keyword)[1])


def test_uncertainty_is_what_data_tell() -> None:
    """Not half the range, at which a fit would hold what it began with."""
    finding = found_as_it_is("backlash")
    assert finding.hypothesis.parameters == (PARAMETER,) and finding.beyond
    assert 1.0 < finding.std[0] / std_alone() < 1.1
    assert abs(finding.estimate[0] - SIZE) < 3.0 * finding.std[0]


@pytest.mark.parametrize(
    ("keyword", "parameters"),
    [("backlash", (PARAMETER,)), pytest.param("pitch", PITCH_PARAMETERS, marks=pytest.mark.slow)],
)
def test_range_does_not_matter(keyword: str, parameters: tuple[str, ...]) -> None:
    """Values, uncertainties and the gain on rows held out are those of an effect within a wider range."""
    _, table = coarse(keyword)
    model = table.problem.model
    ranges = model.ranges.copy()
    ranges[[model.names.index(name) for name in parameters]] *= WIDER
    wide = model.with_ranges(ranges)
    other = replace(table, problem=replace(table.problem, model=wide), candidates=replace(table.candidates, model=wide))
    one, two = found_as_it_is(keyword), found(other)
    assert one.hypothesis.parameters == two.hypothesis.parameters == parameters
    assert one.beyond and not two.beyond
    assert one.estimate == pytest.approx(two.estimate, rel=1e-3)
    assert one.std == pytest.approx(two.std, rel=1e-2)
    assert one.held_out.gain == pytest.approx(two.held_out.gain, rel=0.02)


@pytest.mark.slow
def test_loop_keeps_it() -> None:
    """The improved machine has it in its size, and predicts rows that took no part the better for it."""
    _, table = coarse()
    improvement = improve(table.candidates, table.problem, table.selected, None, ALPHA, SEED)
    assert [h.parameters for h in improvement.accepted] == [(PARAMETER,)]
    fitted = float(improvement.fit.values[improvement.problem.model.names.index(PARAMETER)])
    assert abs(fitted - SIZE) < 3.0 * std_alone()
    assert improvement.confirmed
