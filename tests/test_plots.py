"""`--plot`: what is drawn is what was found, at the scale that is told, and no text lies on another."""

from __future__ import annotations

import xml.etree.ElementTree as ET
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.quiver import Quiver

from pkmcal_cli.calibration.fit import Fit
from pkmcal_cli.calibration.identify import identify
from pkmcal_cli.calibration.measured_problem import problem_of
from pkmcal_cli.calibration.problem import Problem
from pkmcal_cli.calibration.selection import select
from pkmcal_cli.loading.load_machine import load_machine, load_measurements
from pkmcal_cli.pictures.diagnosis_pictures import diagnosis_picture, diagnosis_pictures
from pkmcal_cli.pictures.dot_list import Dot, Scale, dot_part
from pkmcal_cli.pictures.error_map import PlaneErrors, error_map, places_of
from pkmcal_cli.pictures.parameter_picture import parameter_picture
from pkmcal_cli.pictures.parts import composed, rounded, shown_unit, size_text
from pkmcal_cli.pictures.picture import LOOKS
from pkmcal_cli.pictures.residual_picture import residual_parts
from pkmcal_cli.pictures.scatter import Cloud, scatter_part
from pkmcal_cli.pictures.titles import plain, shortened, titles
from pkmcal_cli.report.parameters import ParameterRow
from pkmcal_cli.units.file_units import FileUnits
from pkmcal_cli.units.unit_text import parse_unit
from tests.command import MACHINES, SCISSORS, SHOPFLOOR, TRIGLIDE, TRIGLIDE_DATA, run
from tests.drawn import collisions, collisions_of, figure_of, lines
from tests.in_ci import in_ci
from tests.test_pictures import shop

MM = parse_unit("mm")
UNITS = FileUnits.of({"length": "mm"})
TITLES = titles("m.yaml", "a test", [])
RNG = np.random.default_rng(1)


def grid(count: int = 6, size: float = 0.2) -> np.ndarray:  # type: ignore[type-arg]
    across = np.linspace(-size, size, count)
    return np.array([(x, y) for x in across for y in across])


def places(before: float, after: float, sigma: float = 1e-6) -> PlaneErrors:
    at = grid()
    errors = RNG.normal(size=at.shape)
    return PlaneErrors("xy", at, (("before", before * errors), ("after", after * errors[::-1])), sigma)


def quivers(figure: Figure) -> list[tuple[Quiver, object]]:
    return [(c, ax) for ax in figure.axes for c in ax.collections if isinstance(c, Quiver)]


# --- error maps ----------------------------------------------------------------------------
@pytest.mark.parametrize(("before", "after", "magnified"), [(1e-5, 9e-6, 1), (1e-5, 5e-7, 10), (1e-4, 1e-6, 100)])
def test_arrows_are_errors_at_one_scale(before: float, after: float, magnified: int) -> None:
    shown = places(before, after)
    with figure_of(error_map([shown], TITLES, MM)) as (figure, _):
        found = quivers(figure)
    data = [q for q, _ in found if len(shown.at) == q.N]
    assert len(data) == (2 if magnified == 1 else 3)
    factors = []
    for quiver, (_, errors) in zip(data, (*shown.stages, shown.stages[-1]), strict=False):
        arrows = np.column_stack([quiver.U, quiver.V])
        factor = arrows[0, 0] / errors[0, 0]
        assert arrows == pytest.approx(factor * errors) and quiver.scale == 1
        assert np.asarray(quiver.XY) == pytest.approx(1e3 * shown.at)
        factors.append(factor)
    assert factors[0] == pytest.approx(factors[1])
    if magnified > 1:
        assert factors[2] == pytest.approx(magnified * factors[0])


def test_the_arrow_of_the_key_is_as_long_as_it_says_and_stands_outside_the_data() -> None:
    shown = places(1e-5, 5e-7)
    picture = error_map([shown], TITLES, MM)
    with figure_of(picture) as (figure, texts):
        panels = [ax for ax in figure.axes if ax.axison]
        keys = [ax for ax in figure.axes if not ax.axison]
        assert len(panels) == len(keys) == 3
        for panel, key in zip(panels, keys, strict=True):
            arrows = next(c for c in panel.collections if isinstance(c, Quiver))
            (arrow,) = (c for c in key.collections if isinstance(c, Quiver))
            told = next(t.text for t in texts if t.text.endswith(" um") and ":" not in t.text
                        and key.bbox.contains(*t.box.min))  # fmt: skip
            stage = shown.stages[0] if panel is panels[0] else shown.stages[1]
            pixels = panel.transData.transform([[arrows.U[0], 0], [0, 0]])
            by_error = abs(pixels[0, 0] - pixels[1, 0]) / abs(stage[1][0, 0])
            along = key.transData.transform([[arrow.U[0], 0], [0, 0]])
            assert abs(along[0, 0] - along[1, 0]) == pytest.approx(by_error * float(told.split()[0]) * 1e-6, rel=1e-6)
            assert not panel.bbox.overlaps(key.bbox) or key.bbox.y0 >= panel.bbox.y1 - 1e-6
            for patch in key.patches:
                assert patch.get_gid() == "noise"
                radius = key.transData.transform([[patch.radius, 0], [0, 0]])  # type: ignore[attr-defined]
                assert abs(radius[0, 0] - radius[1, 0]) == pytest.approx(by_error * 2e-6, rel=1e-6)


def test_rms_and_noise_are_told() -> None:
    shown = places(1e-5, 5e-7)
    rms = [np.sqrt((e**2).sum(axis=1).mean()) for _, e in shown.stages]
    with figure_of(error_map([shown], TITLES, MM)) as (_, texts):
        told = [t.text for t in texts]
    assert f"before: {1e6 * rms[0]:.3g} um rms" in told and f"after: {1e6 * rms[1]:.3g} um rms" in told
    assert told.count("2 sigma: 2 um") == 3 and "the same, arrows 10 x" in told


@pytest.mark.parametrize(
    ("at", "before", "after", "sigma"),
    [
        (grid(1, 0.0), 1e-5, 1e-6, 1e-6),  # one row
        (grid(30), 1e-5, 1e-6, 1e-6),  # more rows than arrows
        pytest.param(grid() * [1, 0], 1e-5, 1e-6, 1e-6, marks=pytest.mark.slow),  # on a line
        (grid(), 0.0, 0.0, 1e-6),  # no error at all
        (grid(), 0.3, 1e-9, np.nan),  # errors larger than the machine, and none
        (grid(), 1e-9, 1e-3, 1e-3),  # worse than before; noise larger than the errors
        pytest.param(grid() * 100 + 1e4, 1e-5, 1e-6, 1e-6, marks=pytest.mark.slow),  # a large machine far away
    ],
)
def test_odd_errors_are_drawn(at: np.ndarray, before: float, after: float, sigma: float) -> None:  # type: ignore[type-arg]
    errors = RNG.normal(size=at.shape)
    shown = PlaneErrors("xz", at, (("before", before * errors), ("after", after * errors)), sigma)
    picture = error_map([shown, shown], TITLES, MM)
    with figure_of(picture) as (figure, texts):
        assert collisions_of(figure, texts) == [] and all(np.isfinite(q.U).all() for q, _ in quivers(figure))


@cache
def fitted(name: str) -> tuple[Problem, Fit]:
    loaded = load_machine(str(MACHINES / f"{name}.yaml"))
    problem = problem_of(loaded.model, load_measurements(loaded, [str(MACHINES / f"{name}.csv")]))
    return problem, identify(problem, select(loaded.model, "auto"))


def test_places_of_a_fit_are_its_residuals() -> None:
    problem, fit = fitted("scissors")
    (found,) = places_of(problem, [("before", fit.before.residual), ("calibrated", fit.after.residual)])
    assert found.plane == "xy" and found.sigma == pytest.approx(0.5e-6)
    assert found.at == pytest.approx(problem.readings[:, :2])
    assert found.stages[1][1] == pytest.approx(problem.readings[:, :2] - fit.after.prediction.values[:, :2])
    problem, fit = fitted("hexapod7")
    assert [p.plane for p in places_of(problem, [("calibrated", fit.after.residual)])] == ["xy", "xz"]


def test_without_positions_there_is_no_map() -> None:
    problem, fit = fitted("belt-router")
    assert places_of(problem, [("before", fit.before.residual)]) == []
    assert collisions(composed("r", TITLES, "", residual_parts(problem, fit))) == []


def test_residuals_stand_over_their_drives() -> None:
    problem, fit = fitted("scissors")
    with figure_of(composed("r", TITLES, "", residual_parts(problem, fit))) as (figure, _):
        for k, ax in enumerate(figure.axes):
            x_of, y_of = (line for line in ax.lines if len(line.get_xdata()) == len(problem))  # x and y of the grid
            for c, line in enumerate((x_of, y_of)):
                assert np.asarray(line.get_xdata()) == pytest.approx(1e3 * problem.rows.readings[:, k])
                assert np.asarray(line.get_ydata()) == pytest.approx(1e6 * fit.after.residual[:, c])


# --- parameters and dots -------------------------------------------------------------------
def row(name: str, off: float, std: float | None, identified: bool = True) -> ParameterRow:
    return ParameterRow(
        name=name, nominal=300.0, value=300.0 + off, std=std, by_data=std, by_held=0.0, range=0.1, unit="mm",
        identified=identified, reason=None if identified else "weak: with l2",
    )  # fmt: skip


def test_parameters_are_drawn_in_shares_of_their_ranges() -> None:
    rows = [row("l1", 0.05, 0.01), row("l$2_x$", -0.3, 0.02, False), row("gone", 0, None, False)]
    picture = parameter_picture(rows, TITLES)
    with figure_of(picture) as (figure, texts):
        assert lines(figure, "value-0")[0][0] == pytest.approx([0.5, 0])
        assert lines(figure, "interval-0")[0][:, 0] == pytest.approx([0.5 - 0.196, 0.5 + 0.196])
        assert lines(figure, "value-1")[0][0] == pytest.approx([-3.0, 1])
        assert {"300.050(10) mm", "l$2_x$", "undetermined"} <= {t.text for t in texts}
        assert collisions_of(figure, texts) == []


NUMBERS: list[list[float]] = [[], [np.nan], [1.0], [1e-9, 1e9], [0.5, 0.5], list(np.geomspace(1e-3, 10, 80))]


@pytest.mark.parametrize(
    ("values", "logarithmic"),
    [pytest.param(v, r, marks=[] if r or len(v) == 2 else [pytest.mark.slow]) for v in NUMBERS for r in (False, True)],
)
def test_any_numbers_are_dots(values: list[float], logarithmic: bool) -> None:
    names = [f"a_very_long_name_of_something@somewhere.{k}" for k in range(len(values))]
    dots = [Dot(name=n, value=v, text=f"{v:g}") for n, v in zip(names, values, strict=True)]
    picture = composed("d", TITLES, "", [dot_part(dots, Scale(label="size", logarithmic=logarithmic, line=1.0))])
    with figure_of(picture) as (figure, texts):
        assert collisions_of(figure, texts) == []
        for k, v in enumerate(values[:50]):
            found = lines(figure, f"dot-{k}")
            assert (found == []) if np.isnan(v) else found[0][0, 0] == pytest.approx(v)
        assert not any("mathdefault" in t.text or "$" in t.text for t in texts)


def test_every_marker_is_seen() -> None:
    """Markers are drawn without edges, so one that is nothing but lines would not be there."""
    assert {marker for _, marker in LOOKS} <= set(Line2D.filled_markers)
    assert len({colour for colour, _ in LOOKS}) == len({marker for _, marker in LOOKS}) == len(LOOKS)


def test_places_in_a_line_have_room_for_ticks() -> None:
    """All at one height, but for rounding: the plane xz is no line."""
    at = np.column_stack([grid(4), np.full(16, 0.5) + 1e-7 * RNG.normal(size=16)])
    picture = composed("p", TITLES, "-", [scatter_part([Cloud("u", at, np.ones(16), MM)], ("x", "y", "z"), MM)])
    with figure_of(picture) as (figure, _):
        heights = [ax.get_window_extent().height / figure.dpi for ax in figure.axes[:2]]
    assert min(heights) > 0.6  # inches


def test_sizes_have_units_that_suit_them() -> None:
    assert [size_text(x) for x in (1.23456e-6, 0.9996e-3, 1.37e-3, 1e-16, 2.5)] == [
        "1.23 um", "1 mm", "1.37 mm", "0 um", "2500 mm"
    ]  # fmt: skip
    assert [rounded(x) for x in (0.0099, 0.02, 1.0, 7.0)] == pytest.approx([0.005, 0.02, 1.0, 5.0])
    assert shown_unit("length", 5e-3).text == "mm" and shown_unit("angle", 1e-5).text == "urad"


def test_titles_hold_what_a_page_can() -> None:
    assert plain("a\x00b\ud800\n") == "a\ufffdb\\ud800\ufffd"
    assert shortened("x" * 300, 20) == "x" * 9 + "\u2026" + "x" * 9
    assert titles("/a/b/m.yaml", "draw", ["-"]).machine == "m.yaml"
    picture = composed("d", titles("m" * 300 + ".yaml", "w" * 300, ["c" * 300]), "", [dot_part([], Scale(label="x"))])
    assert collisions(picture) == []


# --- diagnoses -----------------------------------------------------------------------------
@pytest.mark.slow
@pytest.mark.parametrize("whole", [True, False])
def test_no_text_of_a_diagnosis_lies_on_another(whole: bool) -> None:
    drawn = [diagnosis_picture(shop(), TITLES, UNITS)] if whole else list(diagnosis_pictures(shop(), TITLES, UNITS))
    for picture in drawn:
        assert collisions(picture) == [], picture.name
        assert len(picture.alt) > 40
        ET.fromstring(picture.svg())


# --- commands ------------------------------------------------------------------------------
QUICK = ("--holdout", "none", "--select", "l1,l2")
PLAIN, GRIDDED = str(MACHINES / "triglide-nonredundant.yaml"), ("--grid", "x=300:600:4,y=200:350:3")
COMMANDS = {
    "simulate": ("simulate", TRIGLIDE, *GRIDDED, "-o", "t.csv"),
    "forces": ("simulate", SCISSORS, "--grid", "x=-100:100:3,y=-100:100:3", "--forces", "-o", "t.csv"),
    "sensitivity": ("sensitivity", TRIGLIDE, *GRIDDED),
    "along": ("sensitivity", TRIGLIDE, *GRIDDED, "--channel", "x"),
    "observability": ("observability", TRIGLIDE, *GRIDDED),
    "plan": ("plan", PLAIN, *GRIDDED, "--aim", "uncertainty", "--points", "2"),
    "calibrate": ("calibrate", TRIGLIDE, TRIGLIDE_DATA, *QUICK),
    "correct": ("correct", TRIGLIDE, *GRIDDED, "-o", "t.csv"),
    "compare": ("compare", TRIGLIDE, PLAIN, TRIGLIDE_DATA),
}


@pytest.mark.parametrize("name", in_ci([n for n in COMMANDS if n not in ("plan", "compare")], COMMANDS))
def test_every_command_draws_beside_its_result(name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    line = COMMANDS[name]
    plain_run = run(*line, "--json", *(["--force"] if "-o" in line else []))
    done = run(*line, "--json", "--plot", "p.svg", "--force")
    assert done.code == plain_run.code and "written: p.svg" in done.err
    assert done.json.keys() == plain_run.json.keys()
    text = Path("p.svg").read_text(encoding="utf-8")
    assert ET.fromstring(text).tag.endswith("svg") and "mathdefault" not in text
    again = [*line]
    if "-o" in again:
        again[again.index("-o") + 1] = "u.csv"
    kept = run(*again, "-q", "--plot", "p.svg")
    assert kept.code == 4 and "use `--force` to replace it" in kept.err and not Path("u.csv").exists()


def test_a_picture_replaces_no_input_and_no_other_result(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    Path("m.svg").write_bytes(Path(TRIGLIDE).read_bytes())
    before = Path("m.svg").read_bytes()
    done = run("sensitivity", "m.svg", *GRIDDED, "--plot", "m.svg", "--force")
    assert done.code == 4 and "input of the command" in done.err and Path("m.svg").read_bytes() == before
    both = run("simulate", TRIGLIDE, *GRIDDED, "-o", "x.svg", "--plot", "./x.svg")
    assert both.code == 2 and "is already used for another result" in both.err
    for wrong in ("x.gif", "x", "-"):
        done = run("diagnose", SCISSORS, SHOPFLOOR, "--plot", wrong)  # told at once, before the search
        assert done.code == 2 and f"--plot: `{wrong}` is no picture" in done.err


def test_a_map_of_uncertainties(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    assert run("calibrate", PLAIN, PLAIN.replace(".yaml", ".csv"), *QUICK, "-o", "p.yaml", "-q").code == 0
    done = run("simulate", PLAIN, *GRIDDED, "-p", "p.yaml", "--uncertainty", "-o", "t.csv", "--plot", "u.svg")
    drawn = Path("u.svg").read_text(encoding="utf-8")
    assert done.code == 0 and "standard uncertainty<" in drawn and "of the position [um]<" in drawn
    compared = run("compare", "p.yaml", "p.yaml", "--plot", "c.svg")
    assert compared.code == 0 and "95 % interval" in Path("c.svg").read_text(encoding="utf-8")
    runs = run("compare", ".", "--plot", "d.svg")
    assert runs.code == 2 and "a list of runs has no picture" in runs.err
