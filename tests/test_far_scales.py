"""A drive whose scale is off by percents: told by what it should read at measured poses, of any size, by name."""

from __future__ import annotations

from pathlib import Path

import pytest

from pkmcal_cli.diagnosis import far_causes, first_fit, gross_rows, run_diagnosis
from pkmcal_cli.diagnosis.posed_sizes import PosedSize, posed_sizes
from pkmcal_cli.diagnosis.scoring import Scored, Search
from pkmcal_cli.report.console import Reporter
from pkmcal_cli.workflow.search_case import Case, CaseRequest, prepare
from tests.command import MACHINES, clean, run

pytestmark = pytest.mark.usefixtures("unsized")


def scaled(folder: Path, machine: str, drive: str, factor: float, every: int = 1, wrong: tuple[int, ...] = ()) -> Path:
    """Each so many rows of the shipped table, with all readings of a drive times a factor; some rows 100 mm off."""
    head, *lines = [x for x in (MACHINES / f"{machine}.csv").read_text().splitlines() if not x.startswith("#")]
    k = [name.split(" ")[0] for name in head.split(",")].index(drive)
    rows = [line.split(",") for line in lines[::every]]
    for number, row in enumerate(rows):
        row[k] = repr(float(row[k]) * factor + 100.0 * (number in wrong))
    path = folder / "t.csv"
    path.write_text("\n".join([head, *(",".join(row) for row in rows)]) + "\n")
    return path


def case(machine: str, table: Path) -> Case:
    request = CaseRequest(machine=str(MACHINES / f"{machine}.yaml"), measurements=(str(table),))
    return prepare(request, Reporter(quiet=True))


def sizes(machine: str, table: Path) -> dict[str, PosedSize]:
    """Of all constants and scales, by name."""
    made = case(machine, table)
    candidates = [h for h in made.candidates.hypotheses if h.effect in ("zero", "scale", "backlash", "meas_scale")]
    return {h.name: s for h, s in posed_sizes(made.problem, made.candidates.begin(), candidates).items()}


@pytest.mark.parametrize("factor", [0.95, 1.02, 1.05])
@pytest.mark.parametrize("wrong", [(), (3, 11)], ids=["good rows", "two wrong rows"])
def test_the_scale_of_a_drive_is_told_by_measured_poses(factor: float, wrong: tuple[int, ...], tmp_path: Path) -> None:
    """Its travel is the reading over the factor; all else of the machine is off by 0.1 mm on a metre."""
    found = sizes("triglide", scaled(tmp_path, "triglide", "q2", factor, every=8, wrong=wrong))
    (size,) = found["scale@q2"].numbers
    assert size == pytest.approx(1 / factor - 1, abs=1e-3)
    assert found["scale@q2"].left < 0.01
    others = {name: each.left for name, each in found.items() if name.endswith(("@q1", "@q3", "@q4"))}
    assert len(others) >= 4 and min(others.values()) > 0.9
    assert "meas_scale@tracker" not in found, "which displaces no drive"


def test_what_was_found_before_counts(tmp_path: Path) -> None:
    """Beside a scale that is known nothing is left for it, and little for those of all."""
    made = case("triglide", scaled(tmp_path, "triglide", "q2", 1.02, every=8))
    begin = made.candidates.begin()
    begin[made.problem.model.names.index("scale@q2.s")] = 1 / 1.02 - 1
    candidates = [h for h in made.candidates.hypotheses if h.name in ("scale@q2", "scale@all")]
    left = posed_sizes(made.problem, begin, candidates)
    assert [abs(size.numbers[0]) < 1e-3 for size in left.values()] == [True, True]


def test_nothing_is_told_where_hardly_any_pose_is_known(tmp_path: Path) -> None:
    made = case("triglide", scaled(tmp_path, "triglide", "q2", 1.02, every=8))
    few = made.problem.without(range(3, len(made.problem)))
    candidates = [h for h in made.candidates.hypotheses if h.effect == "scale"]
    assert posed_sizes(made.problem, made.candidates.begin(), candidates)
    assert posed_sizes(few, made.candidates.begin(), candidates) == {}


@pytest.fixture
def asked(monkeypatch: pytest.MonkeyPatch) -> dict[str, list[str]]:
    """What a search asks for, by function: names of hypotheses that are fitted, or had been accepted."""
    out: dict[str, list[str]] = {"fit": [], "all in one": [], "gross": [], "starts": []}
    fit, alone, gross = far_causes._fit, run_diagnosis.with_all_in_one, gross_rows._gross_rows

    def all_in_one(search: Search, first: Scored) -> Search:
        out["all in one"] += ["+".join(h.name for h in search.accepted)]
        return alone(search, first)

    monkeypatch.setattr(far_causes, "_fit", lambda s, h, *a: out["fit"].append(h.name) or fit(s, h, *a))
    monkeypatch.setattr(run_diagnosis, "with_all_in_one", all_in_one)
    monkeypatch.setattr(gross_rows, "_gross_rows", lambda *a, **k: out["gross"].append("") or gross(*a, **k))
    monkeypatch.setattr(first_fit, "best_of_starts", lambda *a, **k: out["starts"].append("") or (None, None))
    return out


def test_a_scale_of_percents_of_a_redundant_machine_is_named(tmp_path: Path, asked: dict[str, list[str]]) -> None:
    """15 rows, 2 %: its drives disagree by 20 mm, and no calibration converges; something else was named, at length."""
    table = scaled(tmp_path, "triglide", "q2", 1.02, every=16)
    done = clean(run("diagnose", MACHINES / "triglide.yaml", table, "--json"))
    (found,) = done.json["effects"]
    (size,) = found["parameters"]
    assert (done.code, done.json["verdict"], found["effect"], found["at"]) == (1, "found", "scale", "q2")
    assert abs(size["value"] - 1e6 * (1 / 1.02 - 1)) < 4 * size["std"] < 100 and size["unit"] == "um/m"
    assert asked["all in one"] == ["scale@q2"], "a shape is tried beside it only"
    assert set(asked["fit"]) <= {"scale@q2", "scale@each", "meas_scale@tracker"}, "others leave more of the drives"
    assert len(asked["gross"]) == 1 and not asked["starts"]


@pytest.mark.slow
def test_a_scale_goes_before_a_shape_without_a_name(tmp_path: Path) -> None:
    """A shape has a straight line too, and took up 2 % of one leg of seven before the scale was tried."""
    table = scaled(tmp_path, "hexapod7", "q1", 1.02)
    done = clean(run("diagnose", MACHINES / "hexapod7.yaml", table, "--json"))
    assert [(e["effect"], e["at"]) for e in done.json["effects"]] == [("scale", "q1")]
    assert done.json["verdict"] == "found" and not done.json["unknown"]


@pytest.mark.slow
@pytest.mark.parametrize(
    ("machine", "drive"), [("triglide", "q1"), ("triglide", "q2"), ("delta4", "q4"), ("scissors", "q1")]
)
@pytest.mark.parametrize("factor", [1.005, 1.02, 1.05])
def test_scales_of_percents_are_named(machine: str, drive: str, factor: float, tmp_path: Path) -> None:
    done = clean(run("diagnose", MACHINES / f"{machine}.yaml", scaled(tmp_path, machine, drive, factor), "--json"))
    assert [(e["effect"], e["at"]) for e in done.json["effects"]] == [("scale", drive)]
