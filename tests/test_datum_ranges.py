"""What a datum holds is as far off as its range says: parameters relative to it are known as well as that allows."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from pkmcal_cli.base.rotation import Array
from pkmcal_cli.calibration.held_datum import HeldDatum
from pkmcal_cli.calibration.identifiability import directions
from pkmcal_cli.calibration.prior import Prior
from tests import four_rails
from tests.command import run


def overlaid(folder: Path, text: str) -> Path:
    machine = folder / "m.yaml"
    machine.write_text(four_rails.MACHINE.replace("datum: [h1, z1]\n", text), encoding="utf-8")
    return machine


def calibrated(machine: Path, files: list[str], *more: str) -> dict[str, Any]:
    done = run("calibrate", machine, *files, "--holdout", "none", "--json", *more)
    assert done.code == 0, done.err
    return dict(done.json)


@pytest.fixture
def files(tmp_path: Path) -> list[str]:
    rng = np.random.default_rng(5)
    return four_rails.measure(four_rails.drawn(rng), rng, tmp_path)


def linear(seed: int = 0) -> tuple[Array, Array, Array]:
    """Jacobian (n, 8) in ranges of which some directions are hardly seen, two freedoms (2, 8) that are not, and by what
    the first six are off where one of the other two is."""
    rng = np.random.default_rng(seed)
    free = rng.normal(size=(2, 8))
    basis = np.linalg.qr(np.hstack([free.T, rng.normal(size=(8, 6))]))[0][:, 2:]
    sizes = np.array([100.0, 30.0, 10.0, 1.5, 0.8, 0.3])
    jacobian = np.linalg.qr(rng.normal(size=(20, 6)))[0] * sizes @ basis.T
    return jacobian, free, -free[:, :6].T @ np.linalg.inv(free[:, 6:]).T


def test_directions_relative_to_a_datum_are_those_of_all_parameters() -> None:
    """The same singular values as with the datum's parameters among the free ones, so the same is held; and the
    covariance is that of an estimate in all coordinates, moved to the datum."""
    jacobian, _, beside = linear()
    names, ranges = tuple("abcdefgh"), np.ones(8)
    whole = directions(jacobian, names, ranges)
    relative = directions(jacobian[:, :6], names[:6], ranges[:6], beside=beside)
    assert relative.singular_values == pytest.approx(whole.singular_values[:6], rel=1e-9)
    assert relative.weak.sum() == 3 and not relative.null.any()
    assert relative.duals @ relative.vectors.T == pytest.approx(np.eye(6), abs=1e-9)
    to_datum = np.hstack([np.eye(6), beside])
    moved = to_datum @ whole.determined_covariance(seen=True) @ to_datum.T
    assert relative.determined_covariance() == pytest.approx(moved, rel=1e-9, abs=1e-12)
    alone = directions(jacobian[:, :6], names[:6], ranges[:6])
    assert alone.singular_values != pytest.approx(whole.singular_values[:6], rel=0.05)


def test_a_prior_relative_to_a_datum_has_the_covariance_of_both() -> None:
    _, _, beside = linear()

    class Model:
        names = tuple("abcdefgh")

    rows, centre = np.diag(np.linspace(1.0, 3.0, 8)), np.arange(8.0)
    datum = HeldDatum(("g", "h"), tuple("abcdef"), beside)
    known = Prior(Model.names, rows, centre).relative_to(datum, Model, np.full(8, 0.5))  # type: ignore[arg-type]
    to_datum = np.hstack([np.eye(6), beside])
    expected = to_datum @ np.diag(1 / np.diag(rows) ** 2) @ to_datum.T
    assert np.linalg.inv(known.rows.T @ known.rows) == pytest.approx(expected)
    assert known.centre == pytest.approx(centre[:6] + beside @ (centre[6:] - 0.5))


@pytest.mark.parametrize(
    "more",
    [pytest.param((), id="held"), pytest.param(("--prior", "ranges"), id="prior", marks=pytest.mark.slow)],
)
def test_what_the_datum_is_changes_no_length(files: list[str], tmp_path: Path, more: tuple[str, ...]) -> None:
    """Nor how well it is known: rods, the tool point, distances between rails and balls."""
    first, second = (
        {p["name"]: p for p in calibrated(overlaid(tmp_path, f"datum: {datum}\n"), files, *more)["parameters"]}
        for datum in ("[h1, z1]", "[h4, z3]")
    )
    for name in ("l1", "l2", "l3", "l4", "tx", "ty"):
        assert second[name]["value"] == pytest.approx(first[name]["value"], abs=0.02 * first[name]["std"])
        assert second[name]["std"] == pytest.approx(first[name]["std"], rel=0.02)
    for one, other in (("h2", "h3"), ("z2", "z4"), ("cx[b1]", "z2"), ("cy[b3]", "h3")):
        apart = [found[one]["value"] - found[other]["value"] for found in (first, second)]
        assert apart[1] == pytest.approx(apart[0], abs=2e-4)


def test_a_ball_of_each_session_moves_with_the_base(files: list[str], tmp_path: Path) -> None:
    """Shifts along x and y are recognised, and what holds them is a parameter that a file can name."""
    done = run("calibrate", overlaid(tmp_path, ""), *files, "--holdout", "none")
    assert done.code == 3 and "(shift along x, shift along y)" in done.err
    proposed = done.err[done.err.index("`datum: [") :].split("`")[1]
    found = calibrated(overlaid(tmp_path, f"{proposed}\n"), files)
    assert f"datum: [{', '.join(found['datum'])}]" == proposed and "[b" not in proposed.removeprefix("datum: [")
    assert found["gauge"] == ["shift along x", "shift along y"]
    assert all(p["std"] is not None for p in found["parameters"])


def test_a_wide_range_of_what_an_instrument_looks_at_is_no_slip(tmp_path: Path) -> None:
    """A ball may stand anywhere; a rail may not, nor a ball outside the hall."""
    machine = overlaid(tmp_path, "datum: [h1, z1]\n")
    assert "magnitude" not in run("check", machine).err
    text = machine.read_text(encoding="utf-8")
    machine.write_text(text.replace("range: 0.5", "range: 130"), encoding="utf-8")
    assert "range of z1 = 130 mm: did you mean 130 um?" in run("check", machine).err
    machine.write_text(text.replace("range: 130", "range: 130 m"), encoding="utf-8")
    assert "range of cx = " in run("check", machine).err


@pytest.mark.slow
def test_intervals_relative_to_a_datum_hold(tmp_path: Path) -> None:
    """40 machines drawn as their ranges say, the datum too; within three standard deviations of what chance does, as
    intervals of one machine hold or fail together."""
    machine, inside = overlaid(tmp_path, "datum: [h1, z1]\n"), []
    for seed in range(40):
        rng = np.random.default_rng([7, seed])
        truth = four_rails.drawn(rng)
        tables = four_rails.measure(truth, rng, tmp_path)
        true = four_rails.named(four_rails.relative_to(truth, 0), tables)
        for p in calibrated(machine, tables)["parameters"]:
            inside.append(abs(p["value"] - true[p["name"]]) < 1.96 * p["std"])
    assert len(inside) == 40 * 18 and 0.91 < np.mean(inside) < 0.99


@pytest.mark.slow
def test_a_ball_far_off_leaves_held_directions_at_nominal(tmp_path: Path) -> None:
    """On the way to a ball 60 mm off they turn: the diagnosis blamed four scales that differ, up to 5 standard
    uncertainties from those of `calibrate`. A bar that is too long is as a scale of all: it has one length only."""
    rng = np.random.default_rng(5)
    files = four_rails.measure(four_rails.drawn(rng), rng, tmp_path, bar=0.02)
    done = run("diagnose", overlaid(tmp_path, "datum: [h1, z1]\n"), *files, "--json")
    (found,) = done.json["effects"]
    alike = {("meas_zero", "ballbar"), ("meas_scale", "ballbar"), ("scale", "all")}
    members = {(h["effect"], h["at"]) for h in found["credible_set"]}
    assert (found["effect"], found["at"]) in alike and ("meas_zero", "ballbar") in members <= alike, found
