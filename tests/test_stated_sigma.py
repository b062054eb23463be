"""Uncertainties as certificates state them: a constant part, one that grows with length, a coverage factor."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from pkmcal_cli.calibration.problem import design_problem
from pkmcal_cli.loading.load_machine import load_machine
from pkmcal_cli.prediction import Rows
from pkmcal_cli.workflow.simulated_noise import Noise
from tests.command import MACHINES, clean, run
from tests.test_measured_problem import bound

STATED = {
    "10 um + 20 um/m": (10e-6, 20e-6, 0.0),
    "10um+20um/m": (10e-6, 20e-6, 0.0),
    "0.03 mm + 60 ppm (k = 3)": (10e-6, 20e-6, 0.0),
    "1e+1 um + 2e+1 um/m (k=1)": (10e-6, 20e-6, 0.0),
    "0.03 + 60 um/m (k=3)": (10e-6, 20e-6, 0.0),
    "20 um (k=2)": (10e-6, 0.0, 0.0),
    "20 um (k=2), sigma_per_length: 5 um/m": (10e-6, 0.0, 5e-6),
}
"""How sigma may be written (length in mm): its value at length 0 (m), its linear growth, that in quadrature."""


@pytest.mark.parametrize("text", STATED)
def test_sigma_as_certificates_state_it(text: str, tmp_path: Path) -> None:
    """A linear sum, GUM-wise that of an expanded uncertainty over k: by distance from the origin, by length read."""
    machine = tmp_path / "m.yaml"
    machine.write_text(
        f"extends: {MACHINES / 'scissors.yaml'}\n"
        f"ground: {{drum: [0, -900]}}\n"
        f"sensors: {{grid: {{sigma: {text}}}, wire: {{kind: distance, at: platform, to: drum, sigma: {text}}}}}\n",
        encoding="utf-8",
    )
    table = tmp_path / "t.csv"
    assert run("simulate", machine, "--grid", "x=-200:200:5,y=-200:200:3", "-o", table).code == 0
    problem = bound(machine, table)
    constant, slope, growth = STATED[text]
    far = np.hypot(*problem.readings[:, :2].T)
    for k, length in ((0, far), (1, far), (2, problem.readings[:, 2])):
        expected = np.hypot(constant + slope * length, growth * length)
        np.testing.assert_allclose(problem.sigma[:, k], expected, rtol=1e-12)
    planned = design_problem(problem.model, problem.rows)
    np.testing.assert_allclose(planned.sigma, problem.sigma, rtol=1e-9)


def test_simulated_noise_grows_as_the_certificate_says(tmp_path: Path) -> None:
    """A wire of 700 to 1100 mm: 0.5 mm + 2 mm/m; the scatter of 4000 readings to 5 %."""
    machine = tmp_path / "m.yaml"
    machine.write_text(
        f"extends: {MACHINES / 'scissors.yaml'}\nground: {{drum: [0, -900]}}\n"
        "sensors: {wire: {kind: distance, at: platform, to: drum, sigma: 0.5 mm + 2 mm/m}}\n"
    )
    model = load_machine(str(machine)).model
    noise, length = Noise.of(model, "declared", 1), np.repeat([0.7, 1.1], 2000)
    rows = Rows.at(np.tile(model.reference_readings, (4000, 1)))
    _, drawn = noise.draw(rows)
    k = [c.name for c in model.channels].index("wire")
    readings = np.zeros((4000, len(model.channels)))
    readings[:, k] = length
    made = noise.of_channels(drawn, readings)[:, k].reshape(2, -1)
    assert made.std(axis=1) == pytest.approx([0.5e-3 + 2e-3 * 0.7, 0.5e-3 + 2e-3 * 1.1], rel=0.05)


def test_a_bench_measurement_by_a_certificate(tmp_path: Path) -> None:
    """A length of 950 mm measured to 2 um + 4 um/m (k=2): a standard uncertainty of 2.9 um."""
    machine = tmp_path / "m.yaml"
    machine.write_text(
        f"extends: {MACHINES / 'scissors.yaml'}\n"
        "sensors: {cmm: {kind: bench, of: l1, reading: 950, sigma: 2 um + 4 um/m (k=2)}}\n"
    )
    channel = load_machine(str(machine)).model.channels[-1]
    assert channel.sigma == pytest.approx(2.9e-6, rel=1e-12)


WRONG = {
    "distance, at: A1, to: B1, sigma: 10 um + 5 um": ("`5 um` is in units of length", "`10 um + 5 um/m`"),
    "distance, at: A1, to: B1, sigma: 10 um + L/200": ("`L/200` has no unit", "1000/200 um/m"),
    "distance, at: A1, to: B1, sigma: 10 um + 5 um/m (k=0)": ("not a coverage factor", "(k=2)"),
    "distance, at: A1, to: B1, sigma: l1 (k=2)": ("not a value with a coverage factor", "(k=2)"),
    "distance, at: A1, to: B1, sigma: 10 urad + 5 um/m": ("`10 urad` is an angle", "such as `mm`"),
    "distance, at: A1, to: B1, sigma: 1 um + -5 um/m": ("`-5 um/m` must be positive", "sign"),
    "distance, at: A1, to: B1, sigma: 1 um + 5 um/m, sigma_per_length: 5 ppm": ("given twice", "in quadrature"),
    "touch, at: A1, surface: left, sigma: 10 um + 5 um/m": ("cannot grow with length", "`distance`, `span`, `tcp`"),
    "tcp, at: platform, reads: [rz], frame: machine, sigma: 1 urad + 1 um/m": ("orientation cannot grow", "constant"),
    "bench, of: g1, reading: 0 deg, sigma: 1 urad + 1 um/m": ("`g1` is an angle; its `sigma`", "constant"),
}


@pytest.mark.parametrize("text", WRONG)
def test_what_no_certificate_states(text: str, tmp_path: Path) -> None:
    what, remedy = WRONG[text]
    machine = tmp_path / "m.yaml"
    machine.write_text(f"extends: {MACHINES / 'scissors.yaml'}\nsensors:\n  a: {{kind: {text}}}\n")
    done = clean(run("check", machine, "--json", "-q"))
    faults = done.json["faults"]
    assert done.code == 1 and [f["line"] for f in faults] == [3]
    assert any(what in f["message"] and remedy in (f["help"] or "") for f in faults), faults
