"""Where an effect is offered it does something; where it would do nothing it is refused, never silent."""

from __future__ import annotations

import re
from functools import cache
from pathlib import Path

import numpy as np
import pytest

from pkmcal_cli.base.rotation import Array
from pkmcal_cli.model.model import Model, tcp_model
from pkmcal_cli.prediction import Request, predict
from tests.command import run
from tests.effect_cases import NAMES, WRITTEN, Case, case
from tests.elastic_guide import sliders
from tests.support import SHIPPED, at, model

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


def seen(model: Model, values: Array, c: Case) -> Array:
    """All that is predicted of rows: readings, the TCP, forces of drives (scaled), (N, K)."""
    found = predict(model, values, c.rows, Request(forces=True))
    place = predict(tcp_model(model), values, c.rows)
    assert found.solved.all() and place.solved.all() and found.forces is not None
    return np.hstack([found.values, place.values, found.forces * 1e-10])


@pytest.mark.parametrize("name", MACHINES)
def test_every_offered_effect_changes_a_prediction(name: str) -> None:
    c, values = loaded(name)
    still = seen(c.model, values, c)
    silent = []
    for placed in c.model.effects:
        moved = values.copy()
        for k in [c.model.names.index(n) for n in placed.parameters]:
            moved[k] += STEP * c.model.parameters[k].range
        if placed.effect.keyword != STRAINED and np.abs(seen(c.model, moved, c) - still).max() < FELT:
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
    "sag@rail.y: {c: 10 um}": "`sag` cannot sit at `rail.y`",
    "payload@tracker: {m: 1}": "`payload` cannot sit at `tracker`",
    "thermal_base@all: {a: 11 um/(m*K)}": "`thermal_base` cannot sit at `all`",
    "self_weight@all: {w: 0.1}": "`self_weight` cannot sit at `all`",
    "straight@rail.x: {n2: 10 um}": "`straight` cannot sit at `rail.x`",
}
"""The sliders have no gravity and no mass, and their rail begins at the origin."""


@pytest.mark.parametrize("guidance", ["", "stiffness: {y: 200 kN/mm, rz: 500 kNm/rad}"])
@pytest.mark.parametrize("entry", REFUSED)
def test_an_effect_that_would_do_nothing_is_refused(tmp_path: Path, entry: str, guidance: str) -> None:
    file = tmp_path / "m.yaml"
    file.write_text(sliders(guidance, f"    effects: {{{entry}}}\n"))
    done = run("simulate", file, "--grid", "x=450:550:2,y=340:360:2")
    assert done.code == 3 and REFUSED[entry] in done.err and "help: " in done.err


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
