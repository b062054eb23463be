"""Forces that were read, or commanded, with another sign or unit, or in each other's columns, are told as that.

The truth: three rods hold a point (`test_force_columns.held`); two drives hold carriages by springs, whose forces are
read, and a force is commanded of the third.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from pkmcal_cli.base.rotation import Array
from tests.command import MACHINES, run
from tests.test_force_columns import DRIVES, SLIDERS, held

SENSORS = """sensors:
  grid: {at: tcp, reads: [x, y], sigma: 3 um, frame: machine}
  "f{i}": {each: {i: [1, 2]}, kind: force, drive: "q{i}", sigma: 5 N}
"""
NAMES = ("q1", "q2", "q3.force", "grid.x", "grid.y", "f1", "f2")
UNITS = dict(zip(NAMES, ("mm", "mm", "N", "mm", "mm", "N", "N"), strict=True))


def campaign(seed: int, friction: float = 0.0, rows: int = 40) -> dict[str, Array]:
    """A table of forces in N as they are, with noise of the stated sizes."""
    rng = np.random.default_rng([7, seed])
    places = rng.uniform([300, 240, -1500], [700, 400, 1500], (rows, 3))
    half = np.sqrt(400**2 - (places[:, 1] - 50) ** 2)
    given = np.round(np.column_stack([places[:, 0] - half, places[:, 0] + half, places[:, 2]]), 4)
    travel = places[:, 0] + np.sqrt(700**2 - (places[:, 1] - 50) ** 2)
    sides = np.sign(np.diff(travel, prepend=travel[0] - 1.0))
    there = np.array([held(*row) for row in given - friction * np.outer(sides, [0, 0, 1])])
    forces = DRIVES * (given[:, :2] - there[:, 3:])
    seen = np.hstack([there[:, :2], forces]) + rng.normal(0, [3e-3, 3e-3, 5, 5], (rows, 4))
    return dict(zip(NAMES, np.hstack([given, seen]).T, strict=True))


def diagnosed(folder: Path, table: dict[str, Array], units: dict[str, str] | None = None) -> dict[str, object]:
    """What `diagnose` says of a table whose columns are in some units by its header."""
    file, data = folder / "m.yaml", folder / "t.csv"
    file.write_text(SLIDERS[: SLIDERS.index("sensors:")] + SENSORS)
    head = ",".join(f"{n} [{u}]" for n, u in {**UNITS, **(units or {})}.items())
    rows = [",".join(f"{v:.7f}" for v in row) for row in np.column_stack(list(table.values()))]
    data.write_text("\n".join([head, *rows, ""]))
    return run("diagnose", file, data, "--json").json  # type: ignore[no-any-return]


def told(found: dict[str, object]) -> list[str]:
    """What is said of the table, where it alone is at fault; the searches go on as if it was right."""
    assert (found["verdict"], found["effects"]) == ("measurement_fault", [])
    return found["mistakes"]  # type: ignore[return-value]


@pytest.mark.parametrize("names", [("f1",), ("f2",), ("f1", "f2"), ("q3.force",), ("f1", "q3.force")])
def test_signs(names: tuple[str, ...], tmp_path: Path) -> None:
    table = campaign(0)
    (hint,) = told(diagnosed(tmp_path, {n: -v if n in names else v for n, v in table.items()}))
    assert hint.startswith(", ".join(f"`{n}`" for n in names).replace("`, `", "` and `") + " look")
    assert "reversed in sign: " in hint


@pytest.mark.parametrize(
    ("names", "factor", "said"),
    [
        (("f1",), 1e-3, "1000 times too small (is it in `kN`, not `N`"),
        (("f1", "f2"), 1e-3, "1000 times too small (is it in `kN`, not `N`"),
        (("f2",), 1e3, "1000 times too large (is it in `mN`, not `N`"),
        (("q3.force",), 1e-3, "1000 times too small (is it in `kN`, not `N`"),
        (("q3.force",), 1e3, "1000 times too large (is it in `mN`, not `N`"),
    ],
)
def test_units(names: tuple[str, ...], factor: float, said: str, tmp_path: Path) -> None:
    table = campaign(1)
    (hint,) = told(diagnosed(tmp_path, {n: factor * v if n in names else v for n, v in table.items()}))
    assert all(f"`{n}`" in hint for n in names) and said in hint


@pytest.mark.parametrize("amperes", [0.023, -0.023])
def test_currents_read_as_forces(amperes: float, tmp_path: Path) -> None:
    """Each a motor's with 43 N per ampere: what is to be stated follows."""
    found = diagnosed(tmp_path, {n: amperes * v if n in ("f1", "f2") else v for n, v in campaign(2).items()})
    (hint,) = found["mistakes"]  # type: ignore[misc]
    assert hint.startswith("`f1` and `f2` look 43.") and ("reversed" in hint) is (amperes < 0)
    assert "Its `scale` is to be about 43 times what it is" in hint
    assert found["verdict"] == "measurement_fault"


def test_forces_in_each_others_columns(tmp_path: Path) -> None:
    table = campaign(3)
    table["f1"], table["f2"] = table["f2"], table["f1"]
    (hint,) = told(diagnosed(tmp_path, table))
    assert hint.startswith("`f1` and `f2` look swapped: ")


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("friction", [0.0, 300.0])
def test_right_tables_get_no_hint(friction: float, seed: int, tmp_path: Path) -> None:
    """Also where something is amiss with the forces that is no mistake of the table."""
    found = diagnosed(tmp_path, campaign(10 + seed, friction))
    assert found["mistakes"] == []
    causes = [(e["effect"], e["at"]) for e in found["effects"]]  # type: ignore[attr-defined]
    assert causes == ([("friction", "q3")] if friction else [])


@pytest.mark.parametrize("of", ["weight", "friction"])
def test_forces_of_a_machine_that_has_none_are_in_no_wrong_unit(of: str, tmp_path: Path) -> None:
    """Two drives without redundancy, loads or weight push nothing: no factor makes 50 N of that."""
    machine, data, rng = tmp_path / "m.yaml", tmp_path / "t.csv", np.random.default_rng(1)
    sensors = "".join(f"  f{i}: {{kind: force, drive: q{i}, sigma: 1 N}}\n" for i in (1, 2))
    machine.write_text(f"extends: {MACHINES}/triglide-nonredundant.yaml\nsensors:\n{sensors}", encoding="utf-8")
    lines = (MACHINES / "triglide-nonredundant.csv").read_text(encoding="utf-8").splitlines()
    head, *rows = [line for line in lines if line[:1] != "#"]
    head = head.replace("x [mm]", "tracker.x [mm]").replace("y [mm]", "tracker.y [mm]")
    signs = rng.choice([-1, 1], (len(rows), 2)) if of == "friction" else np.ones((len(rows), 2))
    forces = 50.0 * signs + rng.normal(size=signs.shape)
    table = [f"{row},{a:.3f},{b:.3f}" for row, (a, b) in zip(rows, forces, strict=True)]
    data.write_text("\n".join([f"{head},f1 [N],f2 [N]", *table[::4], ""]), encoding="utf-8")
    done = run("check", machine, data)
    assert done.code == 0 and "times too" not in done.err, done.err
    assert "farther from the nominal machine" in done.err
