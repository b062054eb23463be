"""A point on five ropes, some of them slack, against a general minimiser of the ropes' energy."""

from __future__ import annotations

import json
from itertools import combinations
from pathlib import Path

import numpy as np
import pytest
from scipy.optimize import minimize
from typer.testing import CliRunner

from pkmcal_cli.app import app
from pkmcal_cli.base.rotation import Array
from pkmcal_cli.loading.load_machine import load_machine
from pkmcal_cli.model.model import Model
from pkmcal_cli.prediction import Request, Rows, predict

ANCHORS = np.array([[-1.5, -1, 2], [1.5, -1, 2], [0, 1.2, 2.2], [-1, 0.5, -1], [1.2, 0.4, -1.1]])
STIFFNESS, WEIGHT = 1e5, 5 * 9.80665
ROWS = 100
runner = CliRunner()


def text(redundant: tuple[int, ...]) -> str:
    places = ", ".join(f"A{i}: [x{i}, {1e3 * y}, z{i}]" for i, (_, y, _) in enumerate(ANCHORS, 1))
    names = ", ".join(f"x{i}: {1e3 * x}, z{i}: {1e3 * z}" for i, (x, _, z) in enumerate(ANCHORS, 1))
    drives = "".join(
        f"  q{i}: {{winds: rope{i}, sigma: 0.1 mm{', redundant: true' if i in redundant else ''}}}\n"
        for i in range(1, 6)
    )
    return (
        "units: {length: mm, angle: deg, force: N}\nranges: {length: 3}\nspace: spatial\n"
        f"parameters: {{{names}, EA: {{nominal: 100 kN, range: 10 kN}}}}\n"
        f"gravity: [0, 0, -9.80665]\nground: {{{places}}}\nnodes: {{tcp: {{at: [0, 0, 300], mass: 5 kg}}}}\n"
        'ropes: {"rope{i}": {each: {i: [1, 2, 3, 4, 5]}, between: ["A{i}", tcp], EA: EA}}\n'
        f"actuators:\n{drives}"
        "sensors: {t: {at: tcp, reads: [x, y, z], sigma: 10 um, frame: machine}}\n"
    )


def built(folder: Path, redundant: tuple[int, ...]) -> Model:
    file = folder / f"ropes{redundant[0]}{redundant[1]}.yaml"
    file.write_text(text(redundant), encoding="utf-8")
    return load_machine(str(file)).model


def wound(seed: int, count: int = ROWS) -> tuple[Array, Array]:
    """Places (n, 3), and natural lengths of ropes (n, 5) off by 2 mm: some cannot reach, others are too long."""
    rng = np.random.default_rng(seed)
    places = np.array([0, 0, 0.3]) + rng.uniform(-1, 1, (count, 3)) * [0.5, 0.4, 0.5]
    return places, np.linalg.norm(places[:, None] - ANCHORS, axis=2) + rng.normal(0, 2e-3, (count, 5))


def minimum(place: Array, lengths: Array, anchors: Array = ANCHORS) -> Array:
    """Place of least energy of ropes that only pull, less the work of the weight."""

    def potential(x: Array) -> tuple[float, Array]:
        chord = x - anchors
        now = np.linalg.norm(chord, axis=1)
        e = np.maximum(now - lengths, 0)
        pull = STIFFNESS / lengths * e
        return float(0.5 * (pull * e).sum() + WEIGHT * x[2]), (pull / now) @ chord + [0, 0, WEIGHT]

    found = minimize(potential, place, jac=True, method="BFGS", options={"gtol": 1e-8, "maxiter": 10_000})
    return np.asarray(found.x)


@pytest.mark.parametrize("redundant", [(1, 2), (3, 5), (4, 5)])
def test_which_ropes_carry_follows_from_the_energy(redundant: tuple[int, ...], tmp_path: Path) -> None:
    places, lengths = wound(1)
    true = np.array([minimum(p, l) for p, l in zip(places, lengths, strict=True)])
    reach = np.linalg.norm(true[:, None] - ANCHORS, axis=2) - lengths
    made = built(tmp_path, redundant)
    found = predict(made, made.nominal, Rows.at(lengths), Request(forces=True))
    assert found.solved.all()
    assert np.abs(found.values - true).max() < 1e-8  # of the minimiser
    clear = np.abs(reach) > 1e-7
    slack = np.array([[f"rope{i}" in found.slack.get(k, "") for i in range(1, 6)] for k in range(ROWS)])
    assert (slack == (reach < 0))[clear].all()
    assert slack.any(axis=1).sum() > 50
    assert found.forces is not None
    assert np.abs(found.forces - np.maximum(reach, 0) * STIFFNESS / lengths).max() < 2e-3  # N, of the minimiser
    assert (found.forces[slack] == 0).all()


@pytest.mark.slow
def test_a_thousand_poses_with_every_choice_of_redundant_ropes(tmp_path: Path) -> None:
    places, lengths = wound(9, 1000)
    true = np.array([minimum(p, l) for p, l in zip(places, lengths, strict=True)])
    every = []
    for redundant in combinations(range(1, 6), 2):
        made = built(tmp_path, redundant)
        found = predict(made, made.nominal, Rows.at(lengths))
        assert found.solved.all()
        assert np.abs(found.values - true).max() < 1e-8  # of the minimiser
        every.append(found.values)
    assert np.ptp(every, axis=0).max() < 1e-11


def test_rows_with_slack_ropes_in_any_order_alone_and_started_warm(tmp_path: Path) -> None:
    _, lengths = wound(2)
    made = built(tmp_path, (4, 5))
    found = predict(made, made.nominal, Rows.at(lengths))
    back = predict(made, made.nominal, Rows.at(lengths[::-1]))
    alone = np.concatenate([predict(made, made.nominal, Rows.at(row[None])).values for row in lengths[:20]])
    again = predict(made, made.nominal, Rows.at(lengths), start=found.start)
    for other, part in ((back.values[::-1], slice(None)), (alone, slice(20)), (again.values, slice(None))):
        assert np.abs(other - found.values[part]).max() < 1e-12
    assert again.steps <= 2 * ROWS


def test_derivatives_hold_with_the_carrying_ropes(tmp_path: Path) -> None:
    """Where no rope is about to go slack or taut: exact derivatives of readings and forces against differences."""
    _, lengths = wound(3)
    made = built(tmp_path, (4, 5))
    rows, names = Rows.at(lengths), made.names
    found = predict(made, made.nominal, rows, Request(parameters=names, by_drive=True))
    steady = np.ones(ROWS, dtype=bool)
    assert found.jacobian is not None and found.by_drive is not None
    for k, h in enumerate(1e-5 * made.ranges):
        up, down = (predict(made, made.nominal + way * h * np.eye(len(names))[k], rows) for way in (1, -1))
        same = np.array([found.slack.get(n) == up.slack.get(n) == down.slack.get(n) for n in range(ROWS)])
        steady &= same
        slope = (up.values - down.values) / (2 * h)
        assert np.abs(slope - found.jacobian[:, :, k])[same].max() < 1e-5 * np.abs(slope).max()
    assert steady.sum() > 0.9 * ROWS
    up, down = (predict(made, made.nominal, rows.moved(way * 1e-7 * np.eye(5)[[4]])) for way in (1, -1))
    slope = (up.values - down.values) / 2e-7
    assert np.abs(slope - found.by_drive[:, :, 4])[steady].max() < 1e-5


def test_elongations_of_all_ropes_and_their_derivatives(tmp_path: Path) -> None:
    """Also of slack ones, which reach less far than they are long."""
    _, lengths = wound(4)
    made = built(tmp_path, (4, 5))
    rows, names = Rows.at(lengths), made.names
    found = predict(made, made.nominal, rows, Request(parameters=names, by_drive=True, ropes=True))
    assert found.ropes is not None
    reach = np.linalg.norm(found.values[:, None] - ANCHORS, axis=2) - lengths
    assert np.abs(found.ropes.values - reach).max() < 1e-12

    def elongations(values: Array, moved: Rows) -> tuple[Array, dict[int, tuple[str, ...]]]:
        other = predict(made, values, moved, Request(parameters=names, by_drive=True, ropes=True))
        assert other.ropes is not None
        return other.ropes.values, other.slack

    for k, h in enumerate(1e-5 * made.ranges):
        (up, a), (down, b) = (elongations(made.nominal + way * h * np.eye(len(names))[k], rows) for way in (1, -1))
        same = np.array([found.slack.get(n) == a.get(n) == b.get(n) for n in range(ROWS)])
        slope = (up - down)[same] / (2 * h)
        assert np.abs(slope - found.ropes.jacobian[same, :, k]).max() < 1e-5 * np.abs(slope).max()
    (up, a), (down, b) = (elongations(made.nominal, rows.moved(way * 1e-7 * np.eye(5)[[2]])) for way in (1, -1))
    same = np.array([found.slack.get(n) == a.get(n) == b.get(n) for n in range(ROWS)])
    assert np.abs((up - down)[same] / 2e-7 - found.ropes.by_drive[same, :, 2]).max() < 1e-5


def test_a_row_at_the_kink_is_left_out_of_a_fit(tmp_path: Path) -> None:
    """Three taut ropes hold the point; in one row the two others end between taut and slack, else they hang."""
    built(tmp_path, (4, 5))
    rng = np.random.default_rng(5)
    places = np.array([0, 0, 0.3]) + rng.uniform(-1, 1, (30, 3)) * [0.4, 0.3, 0.4]
    lengths = np.linalg.norm(places[:, None] - ANCHORS, axis=2)
    lengths[:, 3:] += 0.02
    true = np.array([minimum(p, l) for p, l in zip(places, lengths, strict=True)])
    lengths[7, 4] = np.linalg.norm(true[7] - ANCHORS[4])
    table = tmp_path / "m.csv"
    rows = [[*l, *(p + rng.normal(0, 1e-5, 3))] for l, p in zip(lengths, true, strict=True)]
    names = [*(f"q{i}" for i in range(1, 6)), "x", "y", "z"]
    text_rows = "\n".join(",".join(f"{1e3 * v:.6f}" for v in row) for row in rows)
    table.write_text(",".join(f"{n} [mm]" for n in names) + "\n" + text_rows + "\n", encoding="utf-8")
    result = runner.invoke(
        app, ["calibrate", str(tmp_path / "ropes45.yaml"), str(table), "--select", "x1,x2,x3", "--json", "-q"]
    )
    report = json.loads(result.stdout)
    assert result.exit_code == 0
    assert [(f["line"], f["reason"]) for f in report["failed"]] == [(9, "a rope is taut or slack (within 2 std)")]
    for p in report["parameters"]:
        nominal = 1e3 * ANCHORS[int(p["name"][1]) - 1, 0]
        assert abs(p["value"] - nominal) < 4 * p["std"]
        assert p["std_by_data"] < 0.2


def test_forces_beyond_limits_are_warnings(tmp_path: Path) -> None:
    """Limits are compared with what the minimiser says; slack ropes are counted."""
    places, lengths = wound(1)
    true = np.array([minimum(p, l) for p, l in zip(places, lengths, strict=True)])
    pull = np.maximum(np.linalg.norm(true[:, None] - ANCHORS, axis=2) - lengths, 0) * STIFFNESS / lengths
    built(tmp_path, (4, 5))
    limit, least = float(np.sort(pull[:, 0])[-8] - 0.5), float(np.sort(pull[:, 1])[12] + 0.5)
    machine = tmp_path / "limited.yaml"
    machine.write_text(
        text((4, 5))
        .replace("winds: rope1,", f"winds: rope1, force_limit: {limit},")
        .replace("tcp], EA: EA", f"tcp], EA: EA, t_min: {least}"),
        encoding="utf-8",
    )
    table = tmp_path / "q.csv"
    lines = "\n".join(",".join(f"{1e3 * v:.9f}" for v in row) for row in lengths)
    table.write_text(",".join(f"q{i} [mm]" for i in range(1, 6)) + "\n" + lines + "\n", encoding="utf-8")
    result = runner.invoke(app, ["simulate", str(machine), str(table), "-o", str(tmp_path / "o.csv"), "--json"])
    assert result.exit_code == 0
    loads = json.loads(result.stdout)["loads"]
    assert loads["force_limit"][0]["actuator"] == "q1"
    assert loads["force_limit"][0]["n_rows"] == (pull[:, 0] > limit).sum() == 8
    assert loads["force_limit"][0]["largest"] == pytest.approx(pull[:, 0].max(), abs=1e-2)
    by_rope = {entry["rope"]: entry for entry in loads["t_min"]}
    assert by_rope["rope2"]["n_rows"] == (pull[:, 1] < least).sum()
    assert by_rope["rope2"]["least"] == pytest.approx(pull[:, 1].min(), abs=1e-2)
    assert loads["slack"]["n_rows"] == (pull == 0).any(axis=1).sum()
    assert "force of `q1` above its `force_limit`" in result.stderr
    assert "tension of rope `rope2` below its `t_min`" in result.stderr
