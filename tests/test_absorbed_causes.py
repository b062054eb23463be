"""What a calibration takes up in parameters that no machine has: forgotten constants, by independent simulators."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np
import pytest

from tests.benchmark.cases import case as of_benchmark
from tests.benchmark.setting import diagnosed as diagnosis_of
from tests.campaign_tables import true_values, write_table
from tests.command import MACHINES, SCISSORS, Done, clean, run

pytestmark = pytest.mark.usefixtures("unsized")

TRIGLIDE = str(MACHINES / "triglide.yaml")


def with_constants(file: Path, machine: str, constants: Mapping[str, float], rows: int = 60, seed: int = 5) -> str:
    """A campaign in which readings of drives have constants, mm, that nobody knows of."""
    lines = Path(write_table(file, machine, true_values(machine, seed), seed, rows)).read_text().splitlines()
    names = [header.split()[0] for header in lines[0].split(",")]
    cells = np.array([line.split(",") for line in lines[1:]], dtype=float)
    for name, constant in constants.items():
        cells[:, names.index(name)] += constant
    file.write_text("\n".join([lines[0], *(",".join(f"{v:.7f}" for v in row) for row in cells), ""]))
    return str(file)


def diagnosed(machine: str, table: str) -> Done:
    done = clean(run("diagnose", machine, table, "--json"))
    assert done.code == 1 and done.json["verdict"] == "found", done.err
    return done


@pytest.mark.parametrize(
    ("machine", "drive", "constant", "parameter"),
    [
        ("triglide-nonredundant", "q1", 8.0, "xb1r"),
        pytest.param("triglide", "q2", 4.0, "xb2r", marks=pytest.mark.slow),
        pytest.param("scissors", "q2", 12.0, "ya2", marks=pytest.mark.slow),
    ],
)
def test_a_constant_that_a_dimension_takes_up(
    machine: str, drive: str, constant: float, parameter: str, tmp_path: Path
) -> None:
    """The calibration fits to the noise with one dimension 40 to 120 ranges off; the constant is named, and this."""
    table = with_constants(tmp_path / "t.csv", machine, {drive: constant})
    done = diagnosed(str(MACHINES / f"{machine}.yaml"), table)
    (effect,) = done.json["effects"]
    (size,) = effect["parameters"]
    assert (effect["effect"], effect["at"], effect["provisional"]) == ("zero", drive, True)
    assert abs(size["value"] + 1e3 * constant) < 4 * size["std"] < 100 * constant, "um; the ranges are +-100 um"
    assert abs(effect["far_off"][parameter]) == pytest.approx(constant, rel=0.05), "mm"
    assert done.json["chi2_per_dof_before"] < 1.5
    assert "and explain the table as well" in done.err and "check both" in done.err
    without, with_it = effect["heldout_rms_without"], effect["heldout_rms"]
    assert with_it == pytest.approx(without, rel=0.1), "no worse is held out by the dimension"


@pytest.mark.slow
def test_a_wrong_cell_beside_it_is_neither_its_cause_nor_hides_it(tmp_path: Path) -> None:
    """How far ranges turn out to be is asked of the other rows, and what they predict without the cause stays good."""
    table = Path(with_constants(tmp_path / "t.csv", "triglide", {"q2": 4.0}))
    head, *rows = table.read_text().splitlines()
    cells, x = rows[7].split(","), head.split(",").index("x [mm]")
    cells[x] = str(float(cells[x]) + 2.0)
    table.write_text("\n".join([head, *rows[:7], ",".join(cells), *rows[8:], ""]))
    done = diagnosed(TRIGLIDE, str(table))
    (effect,) = done.json["effects"]
    assert (effect["effect"], effect["at"]) == ("zero", "q2") and [r["line"] for r in done.json["outliers"]] == [9]
    assert effect["heldout_rms"] == pytest.approx(effect["heldout_rms_without"], rel=0.1)


@pytest.mark.slow
def test_what_is_improved_by_it_is_not_claimed(tmp_path: Path) -> None:
    """The error before is that of `calibrate`, which has it in a dimension: nothing falls, so nothing is confirmed."""
    table = with_constants(tmp_path / "t.csv", "triglide", {"q2": 4.0})
    fitted = run("calibrate", TRIGLIDE, table, "--json", "-q").json["heldout"]["rms_after"]
    done = clean(run("improve", TRIGLIDE, table, "--only", "zero@q2", "-o", tmp_path / "out.yaml", "--json"))
    before, after = (done.json[k]["position"]["rms"] for k in ("before", "after"))
    assert done.code == 1 and done.json["verdict"] == "not_confirmed"
    assert before == pytest.approx(fitted, rel=0.2) and after == pytest.approx(before, rel=0.1)


@pytest.mark.parametrize("groups", [pytest.param("groups: {upper: [q1, q4]}\n", marks=pytest.mark.slow), ""])
def test_a_constant_of_two_drives(groups: str, tmp_path: Path) -> None:
    """3 mm in both upper carriages of the Scissors: of the group where the file has it, else of each drive."""
    file = tmp_path / "m.yaml"
    file.write_text(f"extends: {SCISSORS}\n{groups}")
    done = diagnosed(str(file), with_constants(tmp_path / "t.csv", "scissors", {"q1": 3.0, "q4": 3.0}))
    (effect,) = done.json["effects"]
    assert effect["effect"] == "zero" and effect["at"] in (("upper", "each:upper") if groups else ("each",))
    for size in effect["parameters"]:
        true = 0.0 if "@q2" in size["name"] or "@q3" in size["name"] else -3000.0
        assert abs(size["value"] - true) < 4 * size["std"] < 1000, "um"


def test_a_dimension_within_reason_is_no_cause(tmp_path: Path) -> None:
    """A bearing 0.6 mm from where it was drawn, six ranges: ranges are guesses, and a constant is no better one."""
    table = Path(write_table(tmp_path / "t.csv", "triglide", true_values("triglide", 5, xb2r=0.6e-3), 5, 60))
    done = clean(run("diagnose", TRIGLIDE, table, "--json"))
    assert done.code == 0 and done.json["verdict"] == "clean"


def test_a_calibration_that_is_implausible_is_not_clean(tmp_path: Path) -> None:
    """A leg 3 mm longer than drawn, 30 ranges, which no constant of a drive explains."""
    machine = "triglide-nonredundant"
    table = write_table(tmp_path / "t.csv", machine, true_values(machine, 5, l1=3e-3), 5, 60)
    done = clean(run("diagnose", MACHINES / f"{machine}.yaml", table, "--json"))
    assert done.code == 1 and done.json["verdict"] == "implausible"
    assert done.json["implausible"] == ["values many ranges off nominal: l1 (31)"]
    assert "because: values many ranges off nominal: l1 (31)" in done.err


@pytest.mark.slow
def test_a_calibration_that_does_not_converge_is_no_matter_of_sigma(tmp_path: Path) -> None:
    """A column of places that have nothing to do with the commands: no cause was found, "sigma is too small"."""
    machine, rng = "triglide-nonredundant", np.random.default_rng(2)
    rows = [line for line in (MACHINES / f"{machine}.csv").read_text(encoding="utf-8").splitlines() if line[:1] != "#"]
    cells = [row.split(",") for row in rows[1:41]]
    text = [",".join([*c[:3], f"{rng.uniform(200, 700):.4f}", c[4]]) for c in cells]
    (tmp_path / "t.csv").write_text("\n".join([rows[0], *text, ""]), encoding="utf-8")
    done = clean(run("diagnose", MACHINES / f"{machine}.yaml", tmp_path / "t.csv", "--json"))
    assert (done.code, done.json["verdict"]) == (1, "implausible")
    assert done.json["implausible"][-1] == "the calibration does not converge"
    assert "sigma is too small" not in done.err


@pytest.mark.slow
@pytest.mark.parametrize("number", [183, 163])
def test_parameters_that_imitate_a_cause_in_part_are_not_believed(number: int) -> None:
    """Wider ranges let declared lengths run 8 to 12 ranges off, and leave half of what is beyond the noise."""
    case = of_benchmark("single", number)
    d = diagnosis_of(case.measured(), case.seed)
    assert [f.hypothesis.name for f in d.findings] == [x.name for x in case.drawn] and not d.unknown
