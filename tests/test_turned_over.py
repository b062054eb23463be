"""Ends of beams and members of joints that are turned over strain nothing, and are no solution all the same."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from scipy.spatial.transform import Rotation

from pkmcal_cli.elements.beam import BeamElement, SpanElement
from pkmcal_cli.elements.element import LinkGeometry
from pkmcal_cli.elements.joint import JOINTS, JointElement
from pkmcal_cli.loading.load_machine import load_machine
from pkmcal_cli.prediction import Rows, predict
from tests.command import MACHINES, run

HEXAPOD, TABLE = MACHINES / "hexapod7.yaml", MACHINES / "hexapod7.csv"
DRIVES = [f"q{k} [mm]" for k in range(1, 8)]
CHORD, ROUNDING = np.array([0.2, 0.0, 0.0]), 1e-15
FREE = {"revolute": "z", "cylindrical": "z", "planar": "z"}


def link(delta: np.ndarray, ti: np.ndarray, tj: np.ndarray) -> LinkGeometry:
    """One link in one row."""
    return LinkGeometry(delta[None, None], ti[None, None], tj[None, None], np.zeros((1, 1, 0)))


def half_turn(axis: str) -> np.ndarray:
    return Rotation.from_euler(axis, 180, degrees=True).as_matrix()


@pytest.mark.parametrize("element", [BeamElement(), BeamElement(planar=True), SpanElement(), SpanElement(planar=True)])
def test_a_beam_that_is_turned_over_strains_nothing(element: BeamElement) -> None:
    rest = np.zeros((1, 1, len(element.strains)))
    rest[..., 0] = 0.2
    straight, over = (link(delta, np.eye(3), np.eye(3)) for delta in (CHORD, -CHORD))
    for each in (straight, over):
        np.testing.assert_allclose(element.evaluate(each, rest)[0], 0.0, atol=ROUNDING)
    assert (element.upright(straight) > 0).all() and (element.upright(over)[..., :2] < 0).all()


def test_a_beam_whose_ends_are_twisted_by_half_a_turn_strains_nothing() -> None:
    element, twisted = BeamElement(), link(CHORD, np.eye(3), half_turn("x"))
    np.testing.assert_allclose(element.evaluate(twisted, np.zeros((1, 1, 6)))[0][..., 1:], 0.0, atol=ROUNDING)
    np.testing.assert_array_equal(element.upright(twisted)[0, 0] < 0, [False, False, True])


@pytest.mark.parametrize(("kind", "axis"), [(kind, axis) for kind in JOINTS for axis in "xyz"])
def test_a_joint_whose_member_is_turned_over_strains_nothing(kind: str, axis: str) -> None:
    """But about an axis about which it may turn."""
    element = JointElement(kind, JOINTS[kind].blocked)
    over = link(np.zeros(3), np.eye(3), half_turn(axis))
    np.testing.assert_allclose(element.evaluate(over, np.zeros((1, 1, len(element.strains))))[0], 0.0, atol=ROUNDING)
    upright = element.upright(over)
    free = kind in ("universal", "spherical") or FREE.get(kind) == axis
    assert upright is None or bool((upright > 0).all()) == free
    assert (upright is None) == (kind in ("universal", "spherical"))


@pytest.mark.parametrize("kind", sorted(FREE))
def test_a_hinge_may_turn_all_the_way_round(kind: str) -> None:
    element = JointElement(kind, JOINTS[kind].blocked)
    for angle in np.linspace(-np.pi, np.pi, 13):
        upright = element.upright(link(np.zeros(3), np.eye(3), Rotation.from_rotvec([0, 0, angle]).as_matrix()))
        assert upright is not None and (upright > 0.99).all()


def legs(tool: np.ndarray) -> np.ndarray:
    """Lengths (N, 7), m, of the legs at poses (N, 6), m and rad: distances of their joints."""
    turn, along = np.radians([[-45, 45, 75, 165, 195, 285, 240], [-15, 15, 105, 135, 225, 255, 315]])
    base, platform = (
        size[:, None] * np.stack([np.cos(angle), np.sin(angle), 0 * angle], axis=1)
        for size, angle in ((np.array([0.4] * 6 + [0.25]), turn), (np.array([0.15] * 6 + [0.1]), along))
    )
    rotation = Rotation.from_rotvec(tool[:, 3:]).as_matrix()
    apart = tool[:, None, :3] + np.einsum("nij,kj->nki", rotation, platform) - base
    return np.asarray(np.linalg.norm(apart, axis=2))


@pytest.mark.parametrize("longer", [0.0, 0.4])
def test_no_beam_of_a_leg_runs_backwards(longer: float) -> None:
    """Legs of 500 mm and what drives read. 400 mm longer, all of them fitted where each upper beam, of 200 mm, ran
    backwards: a pose whose legs are 400 mm shorter than commanded."""
    model, readings = load_machine(str(HEXAPOD)).model, pd.read_csv(TABLE)[DRIVES].to_numpy() * 1e-3
    there = predict(model, model.nominal, Rows.at(readings + longer))
    apart = legs(there.values[there.solved]) - (readings + longer + 0.5)[there.solved]
    assert np.abs(apart).max(initial=0.0) < 0.05, "what legs yield where they disagree"
    assert there.solved.all() or longer > 0


def test_origins_of_drives_are_put_right_for_a_diagnosis(tmp_path: Path) -> None:
    """Lengths of legs where travels are meant, each from an end of its own; noise is all that is left."""
    table, path = pd.read_csv(TABLE), tmp_path / "lengths.csv"
    table[DRIVES] += np.array([512.3, 498.7, 505.1, 497.2, 503.3, 500.9, 487.5])
    table.to_csv(path, index=False)
    done = run("diagnose", HEXAPOD, path)
    assert done.code == 1 and "the measurement is at fault: `q1` is off by 512.3 mm in all rows" in done.err + done.out
    assert "error[row]" not in done.err and "times the stated noise" in done.out + done.err
