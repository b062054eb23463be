"""One wrong cell in a small table: named before the fit that it spoils, and no other mistake is told in its place."""

from __future__ import annotations

from pathlib import Path

import pytest
import yaml

from pkmcal_cli.base.errors import BadInput, Location
from pkmcal_cli.calibration import identify as identify_module
from pkmcal_cli.workflow import calibration as calibration_module
from tests.command import MACHINES, clean, run
from tests.in_ci import in_ci

pytestmark = pytest.mark.usefixtures("unsized")

CASES = {
    "hexapod7": ("rz [rad]", lambda v: 1.5 * v),  # 23 mrad, 37 times what ranges cause
    "triglide": ("q2 [mm]", lambda v: v + 14.8),  # in a table in which q1 = -q2 else
    "scissors": ("x [mm]", lambda v: v + 1.0),  # less than what a look at single rows calls far off
    "delta4": ("q1 [mm]", lambda v: v + 39.6),  # as windup of q1 would, were it the only row with a force
}
ROWS, WRONG = 12, 5


def spoilt(name: str, folder: Path, change: bool = True) -> Path:
    """The first rows of a shipped table, with one cell changed."""
    head, *rows = [line for line in (MACHINES / f"{name}.csv").read_text().splitlines() if not line.startswith("#")]
    cells = [row.split(",") for row in rows[:ROWS]]
    column, changed = CASES[name]
    k = head.split(",").index(column)
    if change:
        cells[WRONG][k] = repr(changed(float(cells[WRONG][k])))
    file = folder / f"{name}-{change}.csv"
    file.write_text("\n".join([head, *(",".join(c) for c in cells), ""]))
    return file


@pytest.fixture(params=[pytest.param("hexapod7", marks=pytest.mark.slow), "triglide", "scissors"])
def name(request: pytest.FixtureRequest) -> str:
    return str(request.param)


def test_it_is_the_reason_and_the_only_one(name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    fits = []
    once = identify_module._identified
    monkeypatch.setattr(identify_module, "_identified", lambda *a, **k: fits.append(1) or once(*a, **k))
    done = run("calibrate", MACHINES / f"{name}.yaml", spoilt(name, tmp_path), "--holdout", "none")
    assert done.code == 1
    told = [line for line in done.err.splitlines() if line.startswith("warning: 1 row is far from what")]
    assert len(told) == 1 and f":{WRONG + 2} ({WRONG + 1})" in told[0]
    assert "column `" not in done.err and "starts follow" not in done.err
    assert len(fits) <= 6


@pytest.mark.parametrize("name", [pytest.param("hexapod7", marks=pytest.mark.slow), "triglide"])
def test_a_robust_loss_does_without_it(name: str, tmp_path: Path) -> None:
    """Also where least squares with the row do not converge."""
    machine, out = MACHINES / f"{name}.yaml", tmp_path / "p.yaml"
    values = []
    for change in (False, True):
        extra = ("--loss", "tukey") if change else ()
        run("calibrate", machine, spoilt(name, tmp_path, change), *extra, "-o", out, "--force", "--holdout", "none")
        written = yaml.safe_load(out.read_text())
        assert written["provenance"]["status"] in ("converged", "incomplete")
        values.append(written["parameters"])
    good, robust = values
    for n, known in good.items():  # undetermined ones are held near nominal by a range of 0.1 mm
        assert abs(robust[n]["value"] - known["value"]) < 4.0 * (known["std"] or 0.05), n


@pytest.mark.parametrize("name", in_ci(["scissors"], list(CASES)))
def test_a_diagnosis_names_it(name: str, tmp_path: Path) -> None:
    found = clean(run("diagnose", MACHINES / f"{name}.yaml", spoilt(name, tmp_path), "--json")).json
    assert found["verdict"] == "measurement_fault"
    assert [row["line"] for row in found["outliers"]] == [WRONG + 2]


HOMED = """extends: {machine}
parameters: {{"z{{i}}": {{each: {{i: [1, 2]}}, nominal: 0, range: 0.1, per: session}}}}
actuators: {{q1: {{zero: z1}}, q2: {{zero: z2}}}}
"""


@pytest.mark.parametrize("wrong", [False, True])
def test_a_session_with_zeros_of_its_own_is_no_mistake(wrong: bool, tmp_path: Path) -> None:
    """Homed anew by 3 mm, with a range of 0.1 mm: three rows that nothing but their zeros sets apart.

    wrong: where one drive reading of the three is 3 mm off besides, they do contradict each other.
    """
    machine = tmp_path / "homed.yaml"
    machine.write_text(HOMED.format(machine=MACHINES / "biglide.yaml"))
    head, *rows = [line for line in (MACHINES / "biglide.csv").read_text().splitlines() if not line.startswith("#")]
    cells = [row.split(",") for row in rows[::4]]
    for cell in cells[-3:]:
        cell[1], cell[2] = repr(float(cell[1]) - 3.0), repr(float(cell[2]) + 1.5)
    if wrong:
        cells[-1][1] = repr(float(cells[-1][1]) + 3.0)
    for name, part in (("a", cells[:-3]), ("b", cells[-3:])):
        (tmp_path / f"{name}.csv").write_text("\n".join([head, *(",".join(c) for c in part), ""]))
    done = run("calibrate", machine, tmp_path / "a.csv", tmp_path / "b.csv", "--holdout", "none")
    assert ("far from what the other rows" in done.err) is wrong


@pytest.mark.parametrize(("off", "rows"), [(0.5, (9, 10, 11)), (0.5, (2, 7, 11)), (40.0, (9, 10, 11))])
def test_rows_that_follow_one_another_have_one_cause(
    off: float, rows: tuple[int, ...], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """An instrument that was knocked before the last three of twelve rows, against three wrong cells anywhere.

    Told before the fit, which is none of this test.
    """

    def ended(*_: object, **__: object) -> None:
        raise BadInput.single("no fit here", Location("m.csv"))

    monkeypatch.setattr(calibration_module, "_fit", ended)
    head, *lines = [line for line in (MACHINES / "triglide.csv").read_text().splitlines() if not line.startswith("#")]
    cells = [line.split(",") for line in lines[:: len(lines) // 12][:12]]
    k = head.split(",").index("x [mm]")
    for row in rows:
        cells[row][k] = repr(float(cells[row][k]) + off)
    file = tmp_path / "m.csv"
    file.write_text("\n".join([head, *(",".join(c) for c in cells), ""]))
    told = run("calibrate", MACHINES / "triglide.yaml", file, "--holdout", "none").err
    assert "3 rows are far from" in told and "no fit here" in told
    assert ("they follow one another" in told) is (rows == (9, 10, 11))
