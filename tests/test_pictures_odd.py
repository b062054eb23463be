"""Pictures of odd content: one row, names of forty letters, a tool that only turns, pulleys."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from pkmcal_cli.calibration.identify import identify
from pkmcal_cli.calibration.mean_sensitivity import sensitivity
from pkmcal_cli.calibration.measured_problem import problem_of
from pkmcal_cli.calibration.selection import select
from pkmcal_cli.loading.load_machine import load_machine, load_measurements
from pkmcal_cli.loading.poses import reference_poses
from pkmcal_cli.pictures.analysis_pictures import PlannedPositions, plan_picture, sensitivity_picture
from pkmcal_cli.pictures.dot_list import Dot, Scale, dot_part
from pkmcal_cli.pictures.machine_picture import machine_picture
from pkmcal_cli.pictures.machine_shape import machine_shape
from pkmcal_cli.pictures.parts import composed
from pkmcal_cli.pictures.residual_picture import residual_parts
from pkmcal_cli.pictures.scatter import moving
from pkmcal_cli.pictures.shapes import MachineShape
from pkmcal_cli.pictures.simulation_picture import Simulated, simulation_picture
from pkmcal_cli.pictures.titles import titles
from pkmcal_cli.prediction import Rows
from pkmcal_cli.units.file_units import FileUnits
from tests.command import MACHINES, TRIGLIDE, TRIGLIDE_DATA, run
from tests.drawn import collisions, figure_of, lines
from tests.pages import all_files, write
from tests.test_draw_joints import EYE, PAGES, on_axis

TITLES = titles("m.yaml", "a test", [])
UNITS = FileUnits.of({"length": "mm", "angle": "deg"})
NAMES = ("x", "y", "z", "rx", "ry", "rz")


def renamed(text: str, names: dict[str, str]) -> str:
    for old, new in names.items():
        text = text.replace(f"{old}:", f"{new}:").replace(f"{old} [", f"{new} [")
    return text


def test_long_names_of_drives_do_not_lie_on_one_another(tmp_path: Path) -> None:
    """Residuals over three drives of forty letters, and the drawing of the machine."""
    names = {f"q{k}": f"linear_axis_with_a_name_of_forty_letters{k}" for k in (1, 2, 3)}
    for file, target in ((TRIGLIDE, "m.yaml"), (TRIGLIDE_DATA, "m.csv")):
        text = renamed(Path(file).read_text(encoding="utf-8"), names)
        (tmp_path / target).write_text(text, encoding="utf-8")
    loaded = load_machine(str(tmp_path / "m.yaml"))
    problem = problem_of(loaded.model, load_measurements(loaded, [str(tmp_path / "m.csv")]))
    fit = identify(problem, select(loaded.model, "auto"))
    assert collisions(composed("r", TITLES, "", residual_parts(problem, fit))) == []
    shape = machine_shape(loaded, loaded.model.nominal, reference_poses(loaded.model).rows, 0)
    assert isinstance(shape, MachineShape) and collisions(machine_picture(shape, TITLES, forces=True)) == []


@pytest.mark.parametrize("count", [1, 2, 5000])
def test_rows_are_counted_in_whole_numbers(count: int) -> None:
    model = load_machine(TRIGLIDE).model
    forces = np.outer(np.arange(1.0, count + 1), np.ones(3))
    result = Simulated(
        model=model, coordinates=("x", "y"), tool=np.zeros((count, 2)), readings=np.zeros((count, 2)),
        forces=forces, uncertainty=None,
    )  # fmt: skip
    with figure_of(simulation_picture(result, TITLES, UNITS)) as (figure, _):
        (ax,) = figure.axes
        low, high = ax.get_xlim()
        ticks = [t for t in ax.get_xticks() if low <= t <= high]
    assert ticks and all(t == round(t) for t in ticks) and low < 1 and high > count


def test_poses_of_a_tool_that_only_turns_are_drawn_as_orientations() -> None:
    """Also those of a plan; a tool that moves, or that stays as it is, has positions."""
    turned = np.hstack([np.zeros((4, 3)), np.radians([[1, 2, 3], [4, 5, 6], [7, 8, 9], [-1, 0, 1]])])
    assert moving(NAMES, turned) == [3, 4, 5]
    assert moving(NAMES, turned + np.eye(4, 6)) == moving(NAMES, turned[:1]) == moving(NAMES, turned[:0]) == [0, 1, 2]
    places = PlannedPositions(turned, np.zeros((0, 6)), NAMES)
    with figure_of(plan_picture(None, TITLES, UNITS, places)) as (figure, _):
        assert [ax.get_ylabel() for ax in figure.axes] == ["ry [deg]", "rz [deg]"]
        at = np.asarray(figure.axes[1].collections[0].get_offsets())
    assert at == pytest.approx(np.degrees(turned[:, [3, 5]]))


def test_what_moves_nothing_has_no_panel(tmp_path: Path) -> None:
    """Parameters of a spherical machine turn its tool and shift nothing; each is told to do so once."""
    (tmp_path / "m.yaml").write_text(EYE, encoding="utf-8")
    model = load_machine(str(tmp_path / "m.yaml")).model
    rows = Rows.at(model.reference_readings[None] + 0.1)
    picture = sensitivity_picture(sensitivity(model, model.nominal, rows, {"z1": 0.01}), model, TITLES)
    with figure_of(picture) as (figure, texts):
        assert len([ax for ax in figure.axes if ax.get_xlabel()]) == 1
        assert any("mean rotation" in t.text for t in texts) and not any("mean shift" in t.text for t in texts)


def test_a_list_without_any_value_has_no_scale() -> None:
    """As of a plan of one point, which shows nothing: names and remarks only."""
    rows = [Dot(name=name, value=np.nan, text="never") for name in ("backlash@q1", "scale@q1")]
    for logarithmic in (True, False):
        part = dot_part(rows, Scale(label="size", logarithmic=logarithmic, line=1.0))
        with figure_of(composed("p", TITLES, "", [part])) as (_, texts):
            assert [t.text for t in texts if t.text.replace(".", "").isdigit()] == []
            assert sum(t.text == "never" for t in texts) == 2


def test_a_pulley_shows_what_it_swivels_about(tmp_path: Path) -> None:
    """The page's winch: the rope comes along -x to the pulley on the ceiling."""
    (tmp_path / "machines").symlink_to(MACHINES)
    write(tmp_path, all_files())
    loaded = load_machine(str(tmp_path / "swivel.yaml"))
    shape = machine_shape(loaded, loaded.model.nominal, reference_poses(loaded.model).rows, 0)
    assert isinstance(shape, MachineShape)
    at = 1e3 * shape.actual.places["top"]
    with figure_of(machine_picture(shape, TITLES, scale=1.0)) as (figure, _):
        drawn = lines(figure, "axis-rope.top")
        for line, name in zip(drawn, ("isometric", "from above (xy)", "from the front (xz)"), strict=True):
            assert on_axis(line, PAGES[name] @ np.array([-1.0, 0, 0]), PAGES[name] @ at)


def test_the_sheet_of_a_machine_that_only_turns_says_where_and_shows_what_is_left(tmp_path: Path) -> None:
    """Without positions: orientations between which was measured, those of the table; residuals over the drives."""
    machine, table, page = tmp_path / "m.yaml", tmp_path / "m.csv", tmp_path / "m.html"
    machine.write_text(EYE, encoding="utf-8")
    angles = [(a, b, c) for a in (-9, 0, 9) for b in (-7, 0, 7) for c in (-5, 0, 5)]
    rows = "".join(f"{a},{b},{c}\n" for a, b, c in angles)
    (tmp_path / "poses.csv").write_text(f"m1 [deg],m2 [deg],m3 [deg]\n{rows}", encoding="utf-8")
    made = run("simulate", machine, tmp_path / "poses.csv", "--noise", "declared", "--seed", 1, "-o", table)
    assert made.code == 0, made.err
    measured = pd.read_csv(table)
    assert run("report", machine, table, "-o", page).code in (0, 1)
    text = page.read_text(encoding="utf-8")
    found = re.search(r"Measured: 27 rows, rx (\S+) to (\S+) deg, ry .* deg, rz (\S+) to (\S+) deg\. The figures", text)
    assert found is not None
    rx, rz = measured["rx [deg]"], measured["rz [deg]"]
    told = [float(number) for number in found.groups()]
    assert told == pytest.approx([rx.min(), rx.max(), rz.min(), rz.max()], rel=1e-3)
    assert "Residuals after calibration over the reading of each drive" in text and "residual of orientation" in text
