"""Poses of machines whose redundancy removes singularities, for the table of what is shown."""

from __future__ import annotations

from itertools import combinations
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

from pkmcal_cli.base.rotation import Array
from pkmcal_cli.model.model import Model
from pkmcal_cli.prediction import Rows, predict
from tests import test_poses, test_slack_ropes
from tests.truth.redundant import DEG, MACHINES, Redundant
from tests.verification_row import Row

FEW, MANY = (3, 100), (7, 1000)
"""Seed and number of poses: those of the page's quick part, and those of the slow tests."""
_WRONG = 1e-7  # m or rad from the minimiser, whose own error is 1e-8
_NAMES = {
    "four legs": "platform on four legs",
    "four cranks": "3-RRR with a fourth leg",
    "seven legs": "hexapod with a seventh leg",
    "delta": "delta with a fourth column",
}


def _rows(what: str, readings: Array, true: Array, models: list[Model]) -> list[Row]:
    """How many poses are wrong or refused, and how far those found with other redundant drives are apart."""
    bad, every = 0, []
    for model in models:
        found = predict(model, model.nominal, Rows.at(readings))
        right = found.solved & (np.abs(found.values - true) < _WRONG).all(axis=1)
        bad += int((~right).sum())
        every.append(found.values)
    places = np.array(every)[..., [k for k, c in enumerate(models[0].channels) if c.dimension == "length"]]
    of = f"{what}, {len(readings)} poses by {len(models)} choices of redundant drives"
    return [
        Row(f"{of}: wrong or refused", "0", bad),
        Row(f"{of}: largest difference between choices, mm", "< 1e-8", float(1e3 * np.ptp(places, axis=0).max())),
    ]


def _turned(machine: Redundant, turn: float, folder: Path, drawn: tuple[int, int]) -> list[Row]:
    seed, count = drawn
    readings, true = test_poses.strained(machine, count, seed, turn)
    most = min(turn, machine.reach[-1]) / DEG
    upto = "" if np.isinf(turn) else f" turned by up to {most:.0f} deg{' about each axis' * (len(machine.home) > 3)}"
    what = f"{_NAMES[machine.name]}{upto}, drives that disagree by 0.2 mm or mrad"
    models = [test_poses.model(machine, redundant, folder) for redundant in range(1, machine.drives + 1)]
    return _rows(what, readings, true, models)


def _ropes(folder: Path, drawn: tuple[int, int]) -> list[Row]:
    places, lengths = test_slack_ropes.wound(*drawn)
    true = np.array([test_slack_ropes.minimum(p, l) for p, l in zip(places, lengths, strict=True)])
    models = [test_slack_ropes.built(folder, (i, j)) for i, j in combinations(range(1, 6), 2)]
    return _rows("point on five ropes off by 2 mm, some slack", lengths, true, models)


def poses() -> list[Row]:
    """Machines of `tests/truth/redundant.py` and a point on five ropes, against minimisers of energy."""
    with TemporaryDirectory() as name:
        folder = Path(name)
        rows = [row for m in MACHINES for turn in test_poses.turns(m) for row in _turned(m, turn, folder, FEW)]
        return [*rows, *_ropes(folder, (1, FEW[1]))]


def many_poses() -> list[Row]:
    """The same at ten times as many poses, those of the slow tests (minutes)."""
    with TemporaryDirectory() as name:
        folder = Path(name)
        rows = [row for m in MACHINES for turn in test_poses.turns(m) for row in _turned(m, turn, folder, MANY)]
        return [*rows, *_ropes(folder, (9, MANY[1]))]
