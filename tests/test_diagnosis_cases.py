"""Some forty simulated campaigns with undeclared effects, diagnosed; all of them are in `python -m tests.benchmark`."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pytest

from pkmcal_cli.diagnosis.run_diagnosis import Diagnosis
from tests.benchmark.setting import Setting, diagnosed
from tests.in_ci import in_ci
from tests.truth.campaigns import Campaign, Planted, Scenario, campaign, unit

FOUND = """
triglide              273418 straight@rail.y*5.45
triglide-nonredundant 826121 thermal_strut@rod2*0.795
scissors              673475 backlash@q3*0.285
scissors              889864 thermal_foot@left*0.0605 slow
delta4                52945  frame@tracker*1.62 slow
triglide              684405 pitch_curve@q2*3.87 straight@rail.y*3.77 slow
triglide              500905 pitch_curve@q1*6.11 slow
triglide-nonredundant 5989   thermal_screw@q2*0.485 slow
triglide-nonredundant 656977 backlash@q2*2.03 slow
scissors              529656 pitch_curve@q2*1.32 slow
delta4                248676 pitch_curve@q2*5.68 slow
scissors              248315 backlash@q2*0.304 windup@q1*0.189 thermal_strut@rod5*0.119 slow
triglide              422374 drift@tracker*1.64 slow
triglide              867208 pitch@q3*6.01 slow
triglide-nonredundant 310351 resetup@s2*0.673 slow
triglide-nonredundant 684078 unequal_backlash@q1*2.43 slow
scissors              119419 pitch@q1*0.344 slow
scissors              262680 drift@grid*0.107 slow
scissors              713370 straight@right.x*0.467 slow
delta4                496131 pitch@q3*3.21 slow
delta4                540689 unequal_backlash@q2*2.68 slow
triglide-nonredundant 718028 thermal_screw@q2*0.557 straight@rail.y*3.28 pitch@q1*2.12 slow
delta4                582788 frame@tracker*6.63 pitch@q1*4.01 slow
"""
"""Machine, seed, effects as multiples of their usual size: each is named at its place, and nothing else."""
SETS = """
triglide              754619 frame@tracker*1.87
triglide-nonredundant 542324 meas_scale@tracker*1.37 slow
scissors              679401 meas_scale@grid*0.17 slow
delta4                541198 carriage_angle@c3.ry*1.18 slow
"""
"""Another effect does the same: a set that holds the truth is named."""
OUTSIDE = """
triglide              721393 oscillation_in_time@tracker*2.58
triglide-nonredundant 767574 oscillation_in_time@tracker*4.6 slow
scissors              683578 oscillation_in_time@grid*2.6
delta4                406545 oscillation_in_time@tracker*2.5 slow
"""
"""Effects of time that are in no catalogue, in units of the noise."""
NO_TEMPERATURE = """
triglide              269166 thermal_strut@rod3*1.95
scissors              220173 thermal_foot@right*0.13
delta4                548172 thermal_strut@arm2a*1.3 slow
"""
"""Effects of a temperature that was not measured."""
NOTHING = """
triglide              277933 normal 1
triglide-nonredundant 2      normal 1 slow
scissors              3      normal 1 slow
delta4                4      normal 1
scissors              615205 normal 1.25
delta4                660072 normal 1.25 slow
triglide              337222 t4     1
"""
"""Machine, seed, kind of noise and true over stated noise, nothing planted: nothing is reported."""
BAD_ROWS = """
triglide-nonredundant 37066
scissors              1
delta4                2 slow
"""


@dataclass(frozen=True)
class Line:
    """A line of these tables."""

    machine: str
    seed: int
    rest: tuple[str, ...]

    @property
    def planted(self) -> list[Planted]:
        """The effects that it lists."""
        found = []
        for text in self.rest:
            name, factor = text.split("*")
            keyword, at = name.split("@")
            found.append(unit(self.machine, keyword, at, self.seed).scaled(float(factor)))
        return found

    @property
    def names(self) -> set[str]:
        """Their names."""
        return {text.split("*")[0] for text in self.rest}

    def diagnosis(self, scenario: Scenario | None = None) -> tuple[Campaign, Diagnosis]:
        """The campaign and what is found in it."""
        measured = campaign(self.machine, self.planted, self.seed, scenario=scenario)
        return measured, diagnosed(measured, self.seed)


def lines(text: str) -> list[object]:
    """The lines of a table as cases; those that end with `slow` are."""
    rows = [(row.removesuffix(" slow").split(), row.endswith(" slow")) for row in text.strip().splitlines()]
    return [
        pytest.param(Line(m, int(s), tuple(rest)), id="-".join([m, s, *rest]), marks=[pytest.mark.slow] if slow else [])
        for (m, s, *rest), slow in rows
    ]


def named(d: Diagnosis) -> set[str]:
    """Effects that are found, with the shape of the catalogue or one of their own."""
    return {f.hypothesis.name for f in d.findings} | {s.named.name for s in d.named_shapes if s.named is not None}


@pytest.mark.parametrize("line", lines(FOUND))
def test_effects_are_named_and_nothing_else(line: Line) -> None:
    _, d = line.diagnosis()
    assert named(d) == line.names
    assert not d.unknown and not d.bad_rows
    assert d.verdict in ("found", "measurement_fault", "ambiguous")
    assert d.search.fit.chi2 < d.before.chi2
    for f in d.findings:
        assert f.hypothesis.name in [r.hypothesis.name for r in f.rivals]


@pytest.mark.parametrize("line", lines(SETS))
def test_where_two_do_the_same_a_set_is_named(line: Line) -> None:
    _, d = line.diagnosis()
    assert d.verdict == "ambiguous"
    assert line.names <= {r.hypothesis.name for f in d.findings for r in f.rivals}


OF_DRIVES = [
    pytest.param("triglide", Planted("zero_drift", "q2", {"o1": 60e-6, "o2": -20e-6}), marks=pytest.mark.slow),
    ("scissors", Planted("zero_drift", "q2", {"o1": 60e-6, "o2": -20e-6})),
    pytest.param("delta4", Planted("zero_drift", "q2", {"o1": 60e-6, "o2": 20e-6}), marks=pytest.mark.slow),
    pytest.param("triglide", Planted("zero", "q1[s2]", {"o": 60e-6}), marks=pytest.mark.slow),
    pytest.param("triglide-nonredundant", Planted("zero", "q2[s2]", {"o": -40e-6}), marks=pytest.mark.slow),
    pytest.param("scissors", Planted("zero", "q4[s2]", {"o": 10e-6}), marks=pytest.mark.slow),
    pytest.param("delta4", Planted("zero", "q1[s2]", {"o": 60e-6}), marks=pytest.mark.slow),
]
"""Zeros that drift, or are others in the second session."""


@pytest.mark.parametrize(("machine", "planted"), OF_DRIVES, ids=lambda v: v if isinstance(v, str) else v.at)
def test_a_zero_that_does_not_stay_is_found(machine: str, planted: Planted) -> None:
    """With its size, if it has the shape of the catalogue; and by name, alone, if it settles exponentially instead."""
    name = f"{planted.keyword}@{planted.at}"
    exact, settling = (diagnosed(campaign(machine, [planted], 7, scenario=Scenario(extra=e)), 7) for e in (0.0, 1.0))
    for d in (exact, settling):
        assert named(d) == {name} and not d.unknown and d.verdict == "found"
    (finding,) = exact.findings
    for estimate, std, (_, value) in zip(finding.estimate, finding.std, planted.values.items(), strict=True):
        assert estimate == pytest.approx(value, abs=4 * std + 0.02 * abs(value)) and std < 0.1 * abs(value)


BOWED = [("triglide", "rail.y"), ("scissors", "left.x"), ("scissors", "right.x"), ("delta4", "rail1.x")]


@pytest.mark.parametrize(("machine", "guide"), in_ci(["triglide-rail.y"], BOWED))
def test_a_bow_is_found_wherever_its_line_lies(machine: str, guide: str) -> None:
    """Ends in their places and the middle 90 um off: the mean is free, so the bow has its size."""
    bow = Planted("straight", guide, {"n2": -60e-6, "n0": 60e-6})
    found = diagnosed(campaign(machine, [bow], 1, scenario=Scenario(extra=0.0)), 1)
    assert named(found) == {f"straight@{guide}"} and not found.unknown
    (finding,) = found.findings
    size = dict(zip((n.rpartition(".")[2] for n in finding.hypothesis.parameters), finding.estimate, strict=True))
    std = dict(zip(size, finding.std, strict=True))
    assert size["n2"] == pytest.approx(-60e-6, abs=4 * std["n2"]) and std["n2"] < 6e-6
    assert set(size) == {"n2", "n0"}, "the bow alone explains it: no other shape is needed"


@pytest.mark.parametrize(("machine", "guide"), in_ci(["scissors-left.x"], BOWED))
def test_a_guide_off_its_place_is_not_called_crooked(machine: str, guide: str) -> None:
    """Nor is it any evidence, even where no parameter takes it up (left of the Scissors)."""
    off = Planted("straight", guide, {"n0": 60e-6})
    assert not any(name.startswith("straight@") for name in named(diagnosed(campaign(machine, [off], 1), 1)))
    setting = Setting.of(machine, 1)
    hypothesis, _ = setting.scores[f"straight@{guide}"]
    linear = setting.linear.projecting(setting.linear.projected, residual=setting.change(off))
    assert linear.score_of(hypothesis).statistic < 1.0
    if guide == "left.x":
        assert linear.score(linear.of(hypothesis.parameters)).statistic > 0.9 * linear.chi2 > 40.0


def test_a_guide_that_is_inclined_is_found_about_its_middle() -> None:
    found = diagnosed(campaign("triglide", [Planted("guide_angle", "rail.y", {"g": 150e-6})], 1), 1)
    assert named(found) == {"guide_angle@rail.y"}
    assert found.findings[0].estimate[0] == pytest.approx(150e-6, abs=4 * found.findings[0].std[0])


@pytest.mark.parametrize(("rod", "k"), [("rod3", -0.9), pytest.param("rod5", -1.4, marks=pytest.mark.slow)])
def test_a_rod_that_is_much_softer_than_its_range_says_is_named(rod: str, k: float) -> None:
    """Declared to 4 %, less than the table could show, and softer by a factor of 2.5 or 4, as with a loose joint: the
    effect, of which that is plausible, stands for the parameter, with its size."""
    d = diagnosed(campaign("scissors", [Planted("stiffness", rod, {"k": k})], 1, scenario=Scenario(extra=0.0)), 1)
    assert named(d) == {f"stiffness@{rod}"} and not d.unknown
    assert d.same[f"release k{rod[-1]}"] == f"stiffness@{rod}"
    (finding,) = d.findings
    assert finding.estimate[0] == pytest.approx(k, abs=3 * finding.std[0])


@pytest.mark.parametrize("line", lines(OUTSIDE))
def test_what_is_in_no_catalogue_is_unknown(line: Line) -> None:
    _, d = line.diagnosis()
    assert d.verdict == "unknown" and "time" in {u.depends_on for u in d.unknown}


@pytest.mark.parametrize("line", lines(NO_TEMPERATURE))
def test_without_a_thermometer_no_part_is_blamed(line: Line) -> None:
    _, d = line.diagnosis(Scenario(omit=("T",)))
    assert not any(not f.hypothesis.measurement and not f.provisional for f in d.findings)
    assert "time" in {u.depends_on for u in d.unknown}
    assert "thermal_strut" in dict(d.not_testable)


@pytest.mark.parametrize("line", lines(NOTHING))
def test_noise_is_no_effect(line: Line) -> None:
    """Where it is 1.25 times what is stated, the statement is doubted, and no part of the machine."""
    noise, factor = line.rest
    measured = campaign(line.machine, [], line.seed, scenario=Scenario(noise=noise, sigma_factor=float(factor)))
    d = diagnosed(measured, line.seed)
    assert not d.findings and not d.unknown
    assert d.verdict == ("sigma_too_small" if float(factor) > 1 else "clean")


@pytest.mark.parametrize("line", lines(BAD_ROWS))
def test_bad_rows_are_found_and_no_others(line: Line) -> None:
    measured, d = line.diagnosis(Scenario(outliers=0.015))
    assert d.bad_rows == tuple(np.nonzero(measured.outlier)[0])
    assert d.verdict == "measurement_fault" and not d.findings and not d.unknown


@pytest.mark.slow
def test_the_same_table_gives_the_same_diagnosis() -> None:
    line = Line("scissors", 673475, ("backlash@q3*0.285",))
    first, again = line.diagnosis()[1], line.diagnosis()[1]
    assert [(f.hypothesis, f.estimate, f.std, f.evidence, f.p_value) for f in first.findings] == [
        (f.hypothesis, f.estimate, f.std, f.evidence, f.p_value) for f in again.findings
    ]
    assert first.search.critical == again.search.critical
