"""What is held as datum changes neither what rows held out say of an effect nor what a shape hides."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from pkmcal_cli.calibration.identify import identify
from pkmcal_cli.compiler.placed_effects import placed_shape, weights_of
from pkmcal_cli.diagnosis.best_fit import best_fit
from pkmcal_cli.diagnosis.confirm import held_out_gain
from pkmcal_cli.diagnosis.scoring import Search
from pkmcal_cli.effects.unexplained import FreeShape, unexplained
from pkmcal_cli.report.console import Reporter
from pkmcal_cli.workflow.search_case import CaseRequest, prepare
from tests import four_rails

DATUMS = ("[h1, z1]", "[h4, z3]")


@pytest.fixture(scope="module")
def searches(tmp_path_factory: pytest.TempPathFactory) -> list[Search]:
    """One campaign with the scale of a drive in the fit, by two datums; few rows, so that directions are held."""
    folder, rng = tmp_path_factory.mktemp("rails"), np.random.default_rng(5)
    files, made = four_rails.measure(four_rails.drawn(rng), rng, folder, rows=14), []
    for datum in DATUMS:
        machine = folder / "m.yaml"
        machine.write_text(four_rails.MACHINE.replace("datum: [h1, z1]", f"datum: {datum}"), encoding="utf-8")
        case = prepare(CaseRequest(machine=str(machine), measurements=tuple(files)), Reporter(quiet=True))
        fit = identify(case.problem, case.selected)
        begun = Search(candidates=case.candidates, problem=case.problem, declared=case.selected, fit=fit)
        search = begun.accepting([h for h in begun.open if h.name == "scale@q2"])
        made.append(replace(search, fit=identify(search.problem, search.selected)))
    return made


def test_rows_held_out_do_not_depend_on_the_datum(searches: list[Search]) -> None:
    """The ranges of what is held as datum count in what is off beside it, as in `calibrate`."""
    assert searches[0].fit.directions.held.any()
    one, other = (held_out_gain(s, s.accepted[0]) for s in searches)
    assert (other.with_it, other.without) == pytest.approx((one.with_it, one.without), rel=1e-3)
    assert other.gain == pytest.approx(one.gain, abs=1e-3 * one.error)


def test_what_a_shape_hides_does_not_depend_on_the_datum(searches: list[Search]) -> None:
    """In rods and in the distance of two rails, of a smooth displacement of a drive that they could imitate."""
    hidden = []
    for search in searches:
        travel = search.problem.rows.readings[:, 0]
        free = FreeShape(knots=tuple(np.linspace(travel.min(), travel.max(), 9).tolist()), spread=1e-5, width=0.2)
        shape = placed_shape(unexplained("command", free, "travel"), "q1", search.problem.model.sites["command"]["q1"])
        model = search.problem.model.with_effects((shape,), weights_of(shape))
        values = np.append(search.fit.values, np.zeros(len(shape.parameters)))
        found = best_fit(replace(search.problem, model=model), values, search.declared, shape.parameters)
        shifts = dict(zip(found.names, found.shifts, strict=True))
        apart = shifts["h2"] - shifts["h3"]
        hidden.append([np.linalg.norm(x) for x in (*(shifts[f"l{k}"] for k in (1, 2, 3, 4)), apart)])
    assert hidden[1] == pytest.approx(hidden[0], rel=1e-2) and min(hidden[0]) > 1e-7, "m"
