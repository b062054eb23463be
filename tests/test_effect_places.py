"""Where an effect is offered it does something; where it would do nothing it is refused, never silent."""

from __future__ import annotations

import re
from functools import cache
from pathlib import Path

import numpy as np
import pytest

from pkmcal_cli.base.rotation import Array
from pkmcal_cli.model.model import Model
from pkmcal_cli.model.tool_channels import tcp_model
from pkmcal_cli.prediction import Request, WarmStart, predict
from tests.command import clean, run
from tests.effect_cases import IN_CI, NAMES, WRITTEN, Case, case
from tests.elastic_guide import sliders
from tests.in_ci import in_ci
from tests.support import SHIPPED, at, model, overlay

MACHINES = (*dict.fromkeys((*NAMES, *SHIPPED)), *WRITTEN)
LOAD = {"hangprinter": 0.03}  # N; its ropes pull with 0.1 N and must not go slack
STRAINED = "stiffness"  # felt only where a force strains it (docs/effects.md); no load strains every spring
STEP = 1e-2
FELT = 1e-11  # m, rad (10 N as 1e-9): of readings, places and forces together


@cache
def loaded(name: str) -> tuple[Case, Array]:
    """The machine under a load at its tool, which stiffness and clearances need to be felt."""
    c = case(name)
    values = c.values.copy()
    for k, p in enumerate(c.model.parameters[c.first :], start=c.first):
        if p.name.startswith("tool_load@"):
            values[k] = LOAD.get(name, 5.0)
    return c, values


def seen(c: Case, tool: Model, values: Array, start: WarmStart | None = None) -> tuple[Array, WarmStart]:
    """All that is predicted of rows: readings, the tool point, forces of drives (scaled), (N, K); a warm start."""
    found = predict(c.model, values, c.rows, Request(forces=True), start)
    place = predict(tool, values, c.rows, start=found.start)
    assert found.solved.all() and place.solved.all() and found.forces is not None
    return np.hstack([found.values, place.values, found.forces * 1e-10]), found.start


@pytest.mark.parametrize("name", in_ci([*IN_CI, "belt-router"], MACHINES))
def test_every_offered_effect_changes_a_prediction(name: str) -> None:
    c, values = loaded(name)
    tool = tcp_model(c.model)
    still, start = seen(c, tool, values)
    silent = []
    for placed in c.model.effects:
        moved = values.copy()
        for k in [c.model.names.index(n) for n in placed.parameters]:
            moved[k] += STEP * c.model.parameters[k].range
        if placed.effect.keyword != STRAINED and np.abs(seen(c, tool, moved, start)[0] - still).max() < FELT:
            silent.append(placed.name)
    assert silent == []


@pytest.mark.parametrize("name", ["elastic-guide", "elastic-towers", "planar-kinds", "spatial-kinds"])
def test_guides_with_stiffness_have_all_their_places(name: str) -> None:
    """As the same guides without: a spring between rail and carriage takes no effect away."""
    names = {placed.name for placed in case(name).model.effects}
    rails = {
        "elastic-guide": ("rail.y", "c1.rz", "c2.rz", "c3.rz"),
        "elastic-towers": ("rail1.x", "rail1.y", "rail4.x", "c1.rx", "c2.ry", "c4.rz"),
        "planar-kinds": ("rail.y", "c1.rz"),
        "spatial-kinds": ("rail.x", "rail.y", "c3.rx", "c3.ry", "c3.rz"),
    }
    for place in rails[name]:
        kinds = ("carriage_angle",) if ".r" in place else ("straight", "guide_angle")
        assert {f"{kind}@{place}" for kind in kinds} <= names


REFUSED = {
    "thermal_base@all: {a: 11 um/(m*K)}": "`thermal_base` cannot be placed at `all`",
    "straight@rail.x: {n2: 10 um}": "`straight` cannot be placed at `rail.x`",
    "sag@rail.x: {c: 10 um}": "`sag` cannot be placed at `rail.x`",
    '"zero@q9[s2]": {o: 10 um}': "`zero` cannot be placed at `q9[s2]`",
    '"zero@all[s2]": {o: 10 um}': "`zero` cannot be placed at `all[s2]`",
    '"scale@q1[s2]": {s: 10 um/m}': "`scale` cannot be placed at `q1[s2]`",
}
"""The sliders have no gravity and no mass, and their rail begins at the origin."""


@pytest.mark.parametrize("guidance", ["", "stiffness: {y: 200 kN/mm, rz: 500 kNm/rad}"])
@pytest.mark.parametrize("entry", REFUSED)
def test_an_effect_that_would_do_nothing_is_refused(tmp_path: Path, entry: str, guidance: str) -> None:
    file = tmp_path / "m.yaml"
    file.write_text(sliders(guidance, f"    effects: {{{entry}}}\n"))
    done = run("simulate", file, "--grid", "x=450:550:2,y=340:360:2")
    assert done.code == 3 and REFUSED[entry] in done.err and "help: " in done.err


def test_an_effect_with_values_of_its_own_is_written_place_by_place(tmp_path: Path) -> None:
    """As `diagnose` names it, it is no place; who writes it so is told how a file says it."""
    file = tmp_path / "m.yaml"
    for place, among in (("each", ""), ("each:lower", " of lower")):
        file.write_text(overlay("hangprinter", f"effects: {{'buildup@{place}': {{}}}}\n"))
        done = run("check", file)
        assert done.code == 1
        assert f"help: write it at each place{among} by itself, `buildup@A` and so on, or with one" in done.err


WEIGHTLESS = {"sag@rail.y: {c: 500 um}": "sag@rail.y", "self_weight@all: {w: 0.9}": "self_weight@all",
              "payload@tracker: {m: 1}": "payload@tracker"}  # fmt: skip


@pytest.mark.parametrize("entry", WEIGHTLESS)
def test_what_acts_by_gravity_stays_valid_without_and_is_warned_of(tmp_path: Path, entry: str) -> None:
    """It does nothing, asks for no column, and no table shows it."""
    file, grid = tmp_path / "m.yaml", ("--grid", "x=450:550:2,y=340:360:2", "-q")
    file.write_text(sliders(""))
    bare = run("simulate", file, *grid)
    file.write_text(sliders("", f"    effects: {{{entry}}}\n"))
    warned, done = clean(run("check", file)), run("simulate", file, *grid)
    assert warned.code == 0 and "warning[no-gravity]" in warned.err
    assert f"`{WEIGHTLESS[entry]}` does nothing: no gravity acts" in warned.err and "gravity: [0, -9.81]" in warned.err
    tables = [[line for line in d.out.splitlines() if not line.startswith("#")] for d in (bare, done)]
    assert done.code == bare.code == 0 and tables[0] == tables[1]
    keyword = WEIGHTLESS[entry].partition("@")[0]
    assert keyword not in {e["effect"] for e in run("effects", file, "--json").json["effects"]}
    with_gravity = sliders("", f"    gravity: [0, -9.81]\n    effects: {{{entry}}}\n").replace(
        "tcp: [500, 350]", "tcp: {at: [500, 350], mass: 9}"
    )
    file.write_text(with_gravity)
    assert "no-gravity" not in run("check", file).err
    assert keyword in {e["effect"] for e in run("effects", file, "--json").json["effects"]}


def test_weights_that_do_not_act_are_told(tmp_path: Path) -> None:
    file = tmp_path / "m.yaml"
    gravity = "    gravity: [0, -9.81]\n    own_weight: false\n"
    effects = "    effects: {self_weight@all: {w: 0.9}, sag@rail.y: {c: 9 um}}\n"
    file.write_text(sliders("", gravity + effects).replace("tcp: [500, 350]", "tcp: {at: [500, 350], mass: 9}"))
    told = run("check", file).err
    assert "`self_weight@all` does nothing" in told and "own_weight" in told and "`sag@rail.y`" not in told


def test_gravity_may_be_a_parameter() -> None:
    """Its direction at nominal is that in which a rail sags."""
    text = sliders("", "    gravity: [0, -g]\n    effects: {sag@rail.y: {c: 500 um, over: [0, 1400]}}\n")
    text = text.replace("parameters: {", "parameters: {g: {nominal: 9.81 m/s^2, range: 1 m/s^2}, ").replace(
        "tcp: [500, 350]", "tcp: {at: [500, 350], mass: 1}"
    )
    fixed = text.replace("[0, -g]", "[0, -9.81]").replace("g: {nominal: 9.81 m/s^2, range: 1 m/s^2}, ", "")
    readings = np.array([[0.2354, 0.7646, 1.1325]])
    np.testing.assert_allclose(at(model(text), readings).values, at(model(fixed), readings).values, atol=1e-13)


def test_a_rail_sags_downwards_however_its_frame_is_turned() -> None:
    """The same rail along x of the base, and along y of a frame that is turned by -90 deg."""
    more = "    gravity: [0, -9.81]\n    effects: {sag@rail.AXIS: {c: 500 um, over: [0, 1400]}}\n"
    plain = sliders("", more.replace("AXIS", "y"))
    turned = sliders("", more.replace("AXIS", "x") + "    frames: {f: {at: [0, 0], turn: -90}}\n")
    turned = re.sub(r"\[0, b(\d)\]", r"[-b\1, 0]", turned).replace("along: x", "frame: f, along: y")
    readings = np.array([[0.2354, 0.7646, 1.1325], [0.3354, 0.8646, 1.2325]])
    bare, one, other = (at(model(t), readings).values for t in (sliders(""), plain, turned))
    assert np.abs(one - bare).max() > 1e-4
    np.testing.assert_allclose(other, one, rtol=0, atol=1e-12)


def test_with_gravity_it_does_something(tmp_path: Path) -> None:
    file = tmp_path / "m.yaml"
    grid = ("--grid", "x=450:550:2,y=340:360:2", "-q")
    texts = []
    for effects in ("", "    effects: {sag@rail.y: {c: 500 um, over: [0, 1400]}}\n"):
        file.write_text(sliders(more=f"    gravity: [0, -9.81]\n{effects}"))
        done = run("simulate", file, *grid)
        assert done.code == 0, done.err
        texts.append([line for line in done.out.splitlines() if not line.startswith("#")])
    assert texts[0] != texts[1]
