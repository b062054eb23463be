"""Forces beyond limits are told by commands that identify nothing, too; linear and rigid name their substructure."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.command import SCISSORS, TRIGLIDE, clean, run


@pytest.fixture
def limited(tmp_path: Path) -> tuple[Path, Path]:
    """A Triglide with a limit of force, and a table: in its second row the third drive is 3 mm off."""
    machine, table = tmp_path / "m.yaml", tmp_path / "t.csv"
    machine.write_text(f"extends: {TRIGLIDE}\nactuators: {{q3: {{force_limit: 20 kN}}}}\n", encoding="utf-8")
    clean(run("simulate", TRIGLIDE, "--grid", "x=500:500:1,y=300:300:1", "-o", table, "-q"))
    *head, names, row = table.read_text(encoding="utf-8").splitlines()
    cells = row.split(",")
    cells[names.split(",").index("q3 [mm]")] = str(float(cells[names.split(",").index("q3 [mm]")]) + 3)
    table.write_text("\n".join([*head, names, row, ",".join(["2", *cells[1:]])]) + "\n", encoding="utf-8")
    return machine, table


@pytest.mark.parametrize("command", ["check", "simulate", "effects", "sensitivity", "observability"])
def test_a_force_above_its_limit_is_a_warning(command: str, limited: tuple[Path, Path]) -> None:
    """Rods of 50 kN/mm, one drive 3 mm off: they bear more than 20 kN; where all drives agree, they bear nothing."""
    extra = ["--simulate"] if command == "effects" else []
    told = run(command, *limited, *extra).err
    assert told.count("force of `q3` above its `force_limit` of 20 kN in 1 of 2 rows") == 1, told


def test_check_reports_it_to_programs(limited: tuple[Path, Path]) -> None:
    warnings = run("check", *limited, "--json").json["measurements"]["warnings"]
    assert [w for w in warnings if "force_limit" in w]


@pytest.mark.parametrize("method", ["linear", "rigid"])
def test_the_papers_methods_name_their_substructure(method: str, tmp_path: Path) -> None:
    table = tmp_path / "t.csv"
    args = ("simulate", SCISSORS, "--grid", "x=0:50:2,y=0:50:2", "-o", table, "--force")
    done = run(*args, "--method", method, "--json")
    assert done.json["substructure"] == ["q1", "q4"]
    assert f"--method {method}: the rigid pose is that of q1, q4, without q2, q3" in done.err
    exact = run(*args, "--json")
    assert "substructure" not in exact.json and "the rigid pose" not in exact.err


@pytest.mark.parametrize("everywhere", [True, False])
def test_forces_within_the_limits_of_all_drives_are_no_warning(everywhere: bool, limited: tuple[Path, Path]) -> None:
    """Where a drive states no limit, parts that are strained by more than ranges explain are."""
    machine, table = limited
    drives = ("q1", "q2", "q3") if everywhere else ("q1", "q2")
    limits = ", ".join(f"{drive}: {{force_limit: 1 MN}}" for drive in drives)
    machine.write_text(f"extends: {TRIGLIDE}\nactuators: {{{limits}}}\n", encoding="utf-8")
    told = run("simulate", machine, table).err
    assert ("warning: the actuators strain the structure" in told) is not everywhere and "force_limit" not in told
