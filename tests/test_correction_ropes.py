"""Ropes under corrected commands: the least tensions, never slack; limits are named where no set values keep them."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from tests.command import Done, run, table
from tests.correction_cases import csv_text
from tests.five_ropes import HOME, LEAST, FiveRopes, rope_text
from tests.truth.pinned import Array

DRIVES = tuple(f"q{i}" for i in range(1, 6))


def corrected(folder: Path, targets: Array, text: str, true: FiveRopes, *options: str) -> tuple[Done, Path]:
    """Commands by the true parameters."""
    (folder / "m.yaml").write_text(text)
    (folder / "p.yaml").write_text(true.parameters())
    (folder / "t.csv").write_text(csv_text(["x [mm]", "y [mm]", "z [mm]"], 1e3 * targets))
    out = folder / "c.csv"
    done = run("correct", folder / "m.yaml", folder / "t.csv", "-p", folder / "p.yaml", "-o", out, "--force", *options)
    return done, out


def places(count: int) -> Array:
    return HOME + np.random.default_rng(5).uniform(-0.5, 0.5, (count, 3))


def columns(path: Path, prefix: str, scale: float = 1.0) -> Array:
    found = table(path).numbers
    return scale * np.stack([np.asarray(found[f"{prefix}{d}"]) for d in DRIVES], axis=1)


def test_tensions_are_least_and_never_below_t_min(tmp_path: Path) -> None:
    """The truth's tensions at the commands are the least ones that hold the weight at the target."""
    true, targets = FiveRopes.drawn(1), places(12)
    done, out = corrected(tmp_path, targets, rope_text(), true)
    assert done.code == 0, done.err
    stated = columns(out, "force.")
    for k, q in enumerate(columns(out, "", 1e-3)):
        found = true.found(q)
        assert found.state.position.astype(float) == pytest.approx(targets[k], abs=1e-9)
        tension = found.tension.astype(float)
        assert tension.min() >= LEAST and tension == pytest.approx(stated[k], abs=1e-5)
        # ropes have the directions of the true pose; 1e-5: the margin that keeps rounding off t_min
        assert tension == pytest.approx(true.least_forces(targets[k], LEAST), abs=3e-4)
    assert columns(out, "force.") == pytest.approx(columns(out, "load.") + columns(out, "internal."), abs=1e-9)


def test_the_internal_part_moves_nothing_and_the_load_part_carries_the_weight(tmp_path: Path) -> None:
    """By unit vectors of the true machine; the load's part is that of least sum of squares without limits."""
    true, targets = FiveRopes.drawn(2), places(6)
    _, out = corrected(tmp_path, targets, rope_text(), true)
    for place, load, internal in zip(targets, columns(out, "load."), columns(out, "internal."), strict=True):
        w = true.directions(place)
        assert w @ internal == pytest.approx(np.zeros(3), abs=0.02)  # ropes stretch by 1e-3 of their length
        assert load == pytest.approx(np.linalg.pinv(w) @ [0, 0, 4 * 9.81], abs=0.05)
        assert abs(internal).max() > 1


@pytest.mark.parametrize("choice", ["min-force", "min-energy"])
def test_limits_that_cannot_be_kept_are_named(choice: str, tmp_path: Path) -> None:
    """Outside of its ropes nothing holds the point; a `force_limit` below what the weight needs does not help."""
    true = FiveRopes.drawn(3)
    done, _ = corrected(
        tmp_path, np.array([[4.0, 4.0, 1.0], [1.5, 1.5, 1.0]]), rope_text(), true, "--redundant", choice
    )
    assert done.code == 1
    assert "t.csv:2: no set values within all limits; in the way: " in done.err and "`t_min` of rope `r1`" in done.err
    assert "1 of 2 targets corrected" in done.err
    done, _ = corrected(tmp_path, HOME[None] + [0, 0, 0.9], rope_text(limit=60.0), true, "--redundant", choice)
    assert done.code == 1 and "`force_limit` of `q" in done.err


def test_a_force_limit_weighs_a_drive(tmp_path: Path) -> None:
    """All limits twice as high: the same forces. One alone: that drive takes more of the load."""
    true, targets = FiveRopes.drawn(4), places(4)
    texts = [rope_text(limit=v) for v in (100.0, 200.0)]
    texts.append(texts[0].replace("q1: {winds: r1, force_limit: 100.0", "q1: {winds: r1, force_limit: 400.0"))
    once, twice, one = (columns(corrected(tmp_path, targets, text, true)[1], "force.") for text in texts)
    assert once == pytest.approx(twice, abs=1e-3)
    assert (one[:, 0] > once[:, 0] - 1e-4).all() and (one[:, 0] > once[:, 0] + 0.5).any()


@pytest.mark.parametrize("choice", ["min-force", "preload"])
def test_ropes_that_hang_without_tension_are_named_with_the_remedy(choice: str, tmp_path: Path) -> None:
    """Least forces leave ropes at 0 N; with `t_min` there is no warning, and its figure is shown."""
    true, targets = FiveRopes.drawn(1), places(12)
    bare = rope_text().replace(f", t_min: {LEAST}", "")
    done, out = corrected(tmp_path, targets, bare, true, "--redundant", choice, "--json")
    loose = np.stack([true.found(q).tension.astype(float) for q in columns(out, "", 1e-3)])
    rows = loose < 0.02 * loose.max(axis=1, keepdims=True)
    assert 0 < rows.any(axis=1).sum() == done.json["hardly_taut"]
    assert [r["hardly_taut"] for r in done.json["ropes"]] == rows.sum(axis=0).tolist()
    assert [r["after"] for r in done.json["ropes"]] == pytest.approx(loose.min(axis=0), abs=1e-4)
    assert f"ropes hardly taut: {rows.any(axis=1).sum()} of 12 targets" in done.err
    assert "`ropes: {r5: {t_min: " in done.err
    done, _ = corrected(tmp_path, targets, rope_text(), true, "--redundant", "min-force", "--json")
    assert done.json["hardly_taut"] == 0 and "hardly taut" not in done.err
    assert {r["t_min"] for r in done.json["ropes"]} == {LEAST}
    assert min(r["after"] for r in done.json["ropes"]) == pytest.approx(LEAST, rel=1e-4)
