"""Status `incomplete`: residuals beyond what a stated sigma, known to ten degrees of freedom, may be wrong by."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import yaml

from tests.command import MACHINES, Done, clean, run
from tests.hostile.campaigns.planted import measured

MACHINE = MACHINES / "triglide-nonredundant.yaml"


def calibrated(folder: Path, noise: float, sigma_is: str = "stated", *more: object) -> Done:
    """60 rows of an independent simulator with so many times the stated noise."""
    table, machine = folder / "m.csv", folder / "m.yaml"
    table.write_text(measured("triglide-nonredundant", 5, rows=60, noise=noise).text(), encoding="utf-8")
    machine.write_text(f"extends: {MACHINE}\nsensors: {{tracker: {{sigma_is: {sigma_is}}}}}\n", encoding="utf-8")
    return clean(run("calibrate", machine, table, "--holdout", "none", "--json", *more))


@pytest.mark.parametrize(
    ("noise", "sigma_is", "status"),
    [
        (1.0, "stated", "converged"),
        (1.4, "stated", "converged"),
        (2.0, "stated", "incomplete"),
        (7.0, "stated", "incomplete"),
        (1.4, "exact", "incomplete"),
        (1.0, "exact", "converged"),
        (7.0, "unknown", "converged"),
    ],
)
def test_status_by_noise(noise: float, sigma_is: str, status: str, tmp_path: Path) -> None:
    done = calibrated(tmp_path, noise, sigma_is)
    assert done.code == 0 and done.json["status"] == done.json["verdict"] == status
    assert bool(done.json["incomplete"]) == (status == "incomplete") and done.json["implausible"] == []


def test_a_robust_loss_goes_by_the_rows_that_it_keeps(tmp_path: Path) -> None:
    assert calibrated(tmp_path, 7.0, "stated", "--loss", "tukey").json["status"] == "incomplete"
    assert calibrated(tmp_path, 1.0, "stated", "--loss", "tukey").json["status"] == "converged"


def test_it_is_told_written_and_repeated_as_a_note(tmp_path: Path) -> None:
    file = tmp_path / "p.yaml"
    done = calibrated(tmp_path, 7.0, "stated", "-o", file)
    assert done.err.count("INCOMPLETE, though converged") == 1 and "next: `diagnose`" in done.err
    written = yaml.safe_load(file.read_text(encoding="utf-8"))["provenance"]
    assert written["status"] == "incomplete"
    again = run("sensitivity", tmp_path / "m.yaml", "-p", file)
    assert f"note: {file}: incomplete: residuals exceed the stated noise" in again.err
    assert "warning" not in again.err


def test_the_instrument_is_named_where_there_are_several() -> None:
    """Lines of the hangprinter stretch, and its spools grow: the ceiling line shows it most."""
    table = MACHINES / "hangprinter_2022-04-12.csv"
    done = clean(run("calibrate", MACHINES / "hangprinter.yaml", table, "--holdout", "none", "--json"))
    told = {text.split(" are ")[0]: float(text.split(" are ")[1].split()[0]) for text in done.json["incomplete"]}
    assert done.code == 0 and set(told) == {"the residuals of camera", "the residuals of D"}
    assert np.argmax(list(told.values())) == list(told).index("the residuals of D")
