"""Every effect at every place: nothing at null, felt, exact derivatives; and what formulas may ask for."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from pkmcal_cli.base.rotation import Array
from pkmcal_cli.effects import STAGES, WIDTHS, catalogue
from pkmcal_cli.prediction import Request, Rows, predict
from pkmcal_cli.prediction.inputs import lag
from pkmcal_cli.units.file_units import parse_unit
from tests.command import SCISSORS, run
from tests.effect_cases import IN_CI, NAMES, WRITTEN, case
from tests.elastic_guide import sliders
from tests.in_ci import in_ci
from tests.support import at, model

STEPS = {"hangprinter": 1e-4}  # of the plausible range; its ropes pull with 0.1 N and must not go slack
ROUNDING = 1e-11  # m or rad: of a predicted reading, by which differences are off
TURNING = "ovality"  # the directions of the pass before are held in derivatives: second order


@pytest.mark.parametrize("name", in_ci([*NAMES, *IN_CI], [*NAMES, *WRITTEN]))
def test_at_null_every_effect_is_the_identity(name: str) -> None:
    c = case(name)
    bare = predict(c.model, c.values, c.rows)
    without = c.model.with_effects((), ())
    object.__setattr__(without, "effects", ())
    assert bare.solved.all()
    np.testing.assert_array_equal(bare.values, predict(without, c.values, c.rows).values)


@pytest.mark.parametrize("name", in_ci(IN_CI, [*NAMES, *WRITTEN]))
def test_signatures_are_derivatives(name: str) -> None:
    """Central differences of the converged model, at a strained pose; a lag has one side only."""
    c = case(name)
    asked = Request(parameters=c.names)
    strained = predict(c.model, c.values, c.rows, asked)
    jacobian = strained.jacobian
    assert jacobian is not None
    felt = set()
    for k, parameter in enumerate(c.model.parameters[c.first :]):
        column = jacobian[..., k] * parameter.range
        if np.abs(column).max() < 1e-12:
            continue
        felt.add(parameter.name.partition("@")[0])
        step = 1e-6 if parameter.dimension == "force" else STEPS.get(name, 1e-3)
        ends = (0.0 if parameter.bounds[0] == 0 else -step, step)
        moved = []
        for end in ends:
            values = c.values.copy()
            values[c.first + k] = end * parameter.range
            moved.append(predict(c.model, values, c.rows, start=strained.start).values)
        difference = (moved[1] - moved[0]) / (ends[1] - ends[0])
        error = np.abs(difference - column).max()
        assert error < 1e-5 * np.abs(column).max() + ROUNDING / step, parameter.name
    expected = {n.partition("@")[0] for n in c.names}
    silent = {"payload", "sag", "thermal_base", "clearance", "windup", "stiffness"}  # without gravity, strain or arms
    assert expected - felt <= silent


@pytest.mark.parametrize("name", in_ci(["triglide"], ["triglide", "delta4"]))
def test_declared_effects_keep_all_derivatives_exact(name: str) -> None:
    """Of declared parameters, of effects and of drive readings, while effects are there, forces included."""
    c = case(name)
    values = c.values.copy()
    for k, p in enumerate(c.model.parameters[c.first :]):
        drawn = np.random.default_rng([2, *p.name.encode()]).normal()  # whatever else the catalogue has
        values[c.first + k] = 0.0 if p.name.startswith(TURNING) else abs(drawn) * 0.05 * p.range
    some = ("scale@", "windup@", "clearance@", "stiffness@")
    names = (*c.model.names[:3], *(n for n in c.names if n.startswith(some)))
    found = predict(c.model, values, c.rows, Request(parameters=names, by_drive=True))
    assert found.jacobian is not None and found.by_drive is not None
    for k, n in enumerate(names):
        place = c.model.names.index(n)
        step = 1e-5 * c.model.parameters[place].range  # forces are felt over 10 N only
        ends = {s: _with(values, place, values[place] + s * step) for s in (-2, -1, 1, 2)}
        at = {s: predict(c.model, end, c.rows, start=found.start).values for s, end in ends.items()}
        difference = (8 * (at[1] - at[-1]) - (at[2] - at[-2])) / (12 * step)  # forces bend it: of the fourth order
        column = found.jacobian[..., k]
        rounding = 1e-5 * np.abs(column).max() + 1e-15 / step
        np.testing.assert_allclose(difference, column, atol=rounding)
    for a in range(found.by_drive.shape[2]):
        shift = np.zeros_like(c.rows.readings)
        inner = np.argsort(c.rows.readings[:, a])[3:-3]  # shapes over the travel must not change with the table
        shift[inner, a] = 1e-8
        ends = [predict(c.model, values, c.rows.moved(s * shift)).values[inner] for s in (-1, 1)]
        np.testing.assert_allclose((ends[1] - ends[0]) / 2e-8, found.by_drive[inner, :, a], rtol=1e-5, atol=1e-5)


def _with(values: np.ndarray, place: int, value: float) -> np.ndarray:  # type: ignore[type-arg]
    out = values.copy()
    out[place] = value
    return out


def test_the_catalogue_says_what_it_is() -> None:
    assert len(catalogue()) >= 30
    for effect in catalogue().values():
        assert effect.enters in STAGES and effect.enters in WIDTHS
        for text in (effect.cause, effect.result, effect.action):
            assert text.endswith(".") and text.format(at="q1", size="21(2) um", repeats="once per period")
        for p in effect.parameters:
            assert p.range > 0 and parse_unit(p.unit) and (p.rotary is None or parse_unit(p.rotary))
        assert effect.source and len({p.name for p in effect.parameters}) == len(effect.parameters)


def test_lag_follows_its_differential_equation() -> None:
    """A ramp is followed at a distance of tau; a step decays by exp(-t/tau); irregular times, any order of rows."""
    rng = np.random.default_rng(0)
    time = np.sort(rng.uniform(0, 10_000, 400))
    ramp = lag(time, 0.01 * time, 500.0)
    np.testing.assert_allclose(ramp[time > 8000], 0.01 * (time[time > 8000] - 500), atol=1e-5)
    mixed = rng.permutation(400)
    np.testing.assert_allclose(lag(time[mixed], 0.01 * time[mixed], 500.0), ramp[mixed], rtol=1e-12)
    fine = np.linspace(0, 5000, 5001)
    step = np.where(fine < 1.0, 0.0, 1.0)
    found = lag(fine, step, 700.0)
    np.testing.assert_allclose(found[1:], 1 - np.exp(-(fine[1:] - 0.5) / 700), atol=1e-3)
    h = 1e-40
    slope = np.imag(lag(time, np.sin(time / 900), 500.0 + 1j * h)) / h
    ends = [lag(time, np.sin(time / 900), 500.0 + s * 1e-3) for s in (-1, 1)]
    np.testing.assert_allclose(slope, (ends[1] - ends[0]) / 2e-3, atol=1e-9)


READINGS = np.array([[0.2354, 0.7646, 1.1325], [0.3354, 0.8646, 1.2325], [0.2854, 0.8046, 1.1925]])
COLUMNS = {
    "time": np.array([0.0, 900.0, 3600.0]), "T": np.full(3, 293.15),
    "session.a": np.array([1.0, 0.0, 0.0]), "session.b": np.array([0.0, 1.0, 1.0]),
}  # fmt: skip


def moved_by(entry: str, limits: str = "") -> Array:
    """Readings (3, 2) of the sliders with an effect declared, in rows of two sessions."""
    text = sliders("", f"    effects:\n      {entry}\n").replace("moves: c1", f"moves: c1{limits}")
    built = model(text)
    found = predict(built, built.nominal, Rows(READINGS, np.full(READINGS.shape, np.nan), COLUMNS))
    assert found.solved.all()
    return found.values


def by_hand(across: Array, along: Array) -> Array:
    """The same where nobody declares an effect: carriages (3, 3) off across the rail, drives (3, 3) off along it, m."""
    bare, rows = model(sliders("")), []
    for off, more, row in zip(across, along, READINGS, strict=True):
        points = {f"b{k + 1}": 0.05 + float(off[k]) for k in range(3)}
        rows.append(at(bare, row + more, **points).values[0])
    return np.array(rows)


NO = np.zeros((3, 3))
HOUR = np.array([-1.0, -0.5, 1.0])  # place of the rows in an hour
BY_HAND = {
    "guide_angle@rail.y: {g: 300 urad, over: [100, 1300]}": (300e-6 * (READINGS - 0.7), NO),
    "straight@rail.y: {n0: 60 um, n2: 80 um, over: [100, 1300]}": (
        60e-6 + 80e-6 * (1.5 * ((READINGS - 0.7) / 0.6) ** 2 - 0.5), NO,
    ),
    "zero@q2[b]: {o: 50 um}": (NO, 50e-6 * np.outer([0, 1, 1], [0, 1, 0])),
    "zero@q3[a]: {o: -50 um}": (NO, -50e-6 * np.outer([1, 0, 0], [0, 0, 1])),
    "zero@q2[elsewhere]: {o: 50 um}": (NO, NO),
    "zero_drift@q1: {o1: 40 um, o2: 10 um, during: [0, 3600]}": (
        NO, np.outer(40e-6 * HOUR + 10e-6 * (1.5 * HOUR**2 - 0.5), [1, 0, 0]),
    ),
    "zero_drift@q1: {o1: 40 um}": (NO, np.outer(40e-6 * HOUR, [1, 0, 0])),
    "zero_drift@q1: {o1: 40 um, during: [-3600, 3600]}": (NO, np.outer(40e-6 * (HOUR + 1) / 2, [1, 0, 0])),
}  # fmt: skip
"""What effects do to carriages and drives."""


@pytest.mark.parametrize("entry", BY_HAND)
def test_guides_and_zeros_move_as_if_by_hand(entry: str) -> None:
    across, along = BY_HAND[entry]
    np.testing.assert_allclose(moved_by(entry), by_hand(np.asarray(across), np.asarray(along)), rtol=0, atol=1e-12)


def test_a_guide_turns_about_the_middle_of_what_is_travelled() -> None:
    """Without `over`: of the limits where all drives have some, else of the table; carriages of one guide together."""
    table = by_hand(300e-6 * (READINGS - 0.5 * (READINGS.min() + READINGS.max())), NO)
    np.testing.assert_allclose(moved_by("guide_angle@rail.y: {g: 300 urad}"), table, rtol=0, atol=1e-12)
    limits = by_hand(300e-6 * (READINGS - 0.5 * (0.1 + READINGS.max())), NO)
    found = moved_by("guide_angle@rail.y: {g: 300 urad}", ", limits: [100, 500]")
    np.testing.assert_allclose(found, limits, rtol=0, atol=1e-12)


FAULTS = {
    "bcklash@q1: {b: 1 um}": ["unknown effect `bcklash`", "did you mean `backlash`?"],
    "backlash@q9: {b: 1 um}": ["`backlash` cannot be placed at `q9`"],
    "backlash@q1: {c: 1 um}": ["`backlash` has no parameter `c`", "use one of b"],
    "backlash@q1: {b: 1 deg}": ["`1 deg` is an angle; expected a length"],
    "backlash: {b: 1 um}": ["`backlash` is not a valid effect name"],
    "straight@left.x: {n2: 1 um, over: [5, -5]}": ["the first limit must be below the second"],
    "pitch@q1: {c: 1 um}": ["effect `pitch@q1` needs `period`"],
}


def test_columns_that_effects_need(tmp_path: Path) -> None:
    """A table must have them; on a grid nobody measured anything, and effects are at rest."""
    file = tmp_path / "m.yaml"
    file.write_text(f"extends: {SCISSORS}\neffects:\n  thermal_strut@rod1: {{a: 1 um/(m*K)}}\n")
    table = run("simulate", str(file), SCISSORS.replace(".yaml", ".csv"))
    assert table.code == 3 and "effect `thermal_strut@rod1` needs the column `T.rod1` or `T`" in table.err
    grid = ("--grid", "x=-100:100:2,y=-100:100:2")
    rest, plain = run("simulate", str(file), *grid), run("simulate", SCISSORS, *grid)
    assert (
        rest.code == 0
        and "effects that depend on temperature are evaluated at reference conditions: 20 degC" in rest.err
    )
    rows = [[line for line in done.out.splitlines() if not line.startswith("#")] for done in (rest, plain)]
    cells = [np.array([line.split(",") for line in lines[1:]], dtype=float) for lines in rows]
    np.testing.assert_allclose(*cells, rtol=1e-12)
    file.write_text(f"extends: {SCISSORS}\neffects:\n  backlash@q1: {{b: 40 um}}\n")
    played = run("simulate", str(file), *grid)
    moved = [line for line in played.out.splitlines() if not line.startswith("#")]
    assert played.code == 0 and moved != rows[1], "directions follow from the order of a grid's rows"


@pytest.mark.parametrize("entry", FAULTS)
def test_wrong_effects_are_told(entry: str, tmp_path: Path) -> None:
    file = tmp_path / "m.yaml"
    file.write_text(f"extends: {SCISSORS}\neffects:\n  {entry}\n")
    done = run("simulate", str(file), "--grid", "x=-100:100:2,y=-100:100:2")
    assert done.code == 3 and "Traceback" not in done.err
    for text in FAULTS[entry]:
        assert text in done.err
