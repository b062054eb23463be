"""Pictures of a diagnosis: errors before and after, every effect over what drives it, steps to noise, rivals."""

from __future__ import annotations

import os
from collections.abc import Collection, Iterator
from typing import TYPE_CHECKING, Any

import numpy as np

from pkmcal_cli.base.outputs import check_target, make_folder
from pkmcal_cli.base.rotation import Array
from pkmcal_cli.diagnosis.panels import DriverPanel, driver_panel, nearest_rivals
from pkmcal_cli.diagnosis.run_diagnosis import Diagnosis
from pkmcal_cli.diagnosis.waterfall import waterfall
from pkmcal_cli.pictures.error_map import PlaneErrors, error_map, errors_in_words, map_part, places_of
from pkmcal_cli.pictures.parts import Part, composed, plain_log, size_text
from pkmcal_cli.pictures.picture import AFTER, BEFORE, FITTED, NOISE, Picture, write_picture
from pkmcal_cli.pictures.residual_picture import kind_part
from pkmcal_cli.pictures.shape_picture import shape_in_words, shape_part
from pkmcal_cli.pictures.titles import Titles, plain, shortened
from pkmcal_cli.report.number_format import three_digits
from pkmcal_cli.units.file_units import FileUnits
from pkmcal_cli.units.measurands import Measurand
from pkmcal_cli.units.unit_text import Unit

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure, SubFigure

_NAME = 36  # characters
_ROUND = 0.02  # spread of the radius below which poses lie on a circle
_CALIBRATED, _WITH, _SHAPED = "calibrated", "with effects found", "with the curve found"


def write_pictures(folder: str, pictures: Collection[Picture], inputs: Collection[str]) -> list[str]:
    """Write pictures into a folder, over none of the inputs; returns the files. Raises OutputError."""
    make_folder(folder)
    files = {os.path.join(folder, f"{picture.name}.svg"): picture for picture in pictures}
    for file in files:
        check_target(file, inputs, force=True)
    for file, picture in files.items():
        write_picture(picture, file, inputs, force=True)
    return list(files)


def diagnosis_pictures(diagnosis: Diagnosis, titles: Titles, units: FileUnits) -> Iterator[Picture]:
    """The whole set; `units`: of the machine file."""
    for places in diagnosed_places(diagnosis):
        yield error_map([places], titles, units.length, f"errors-{places.plane}")
        if is_circle(places.at):
            yield circle_picture(places, titles, units.length, f"circle-{places.plane}")
    if (shown := shown_part(diagnosis)) is not None:
        yield composed("residuals", titles, _residuals_in_words(diagnosis), [shown])
    for panel in effect_panels(diagnosis):
        name = panel.finding.hypothesis.name
        yield composed(f"effect-{name}", titles, panel_in_words(panel), [driver_part(panel)])
    for shape in diagnosis.shapes:
        name = shape.hypothesis.name.replace(":", "-")  # no file name on Windows has a colon
        yield composed(name, titles, shape_in_words(shape), [shape_part(shape, units)])
    steps = ", ".join(f"{s.name} {s.noise:.3g}" for s in waterfall(diagnosis))
    alt = f"Rms of the residual in standard uncertainties of the readings, step by step: {steps}."
    yield composed("variance", titles, alt, [waterfall_part(diagnosis)])
    if diagnosis.findings:
        near = (f"{n.name} and {n.rival} {n.cosine:.2f}" for n in nearest_rivals(diagnosis))
        alt = f"Effects found, and the one most similar to each, by the cosine between them: {', '.join(near)}."
        yield composed("ambiguity", titles, alt, [rivals_part(diagnosis)])


def diagnosis_picture(diagnosis: Diagnosis, titles: Titles, units: FileUnits) -> Picture:
    """The same in one picture."""
    places = diagnosed_places(diagnosis)
    shown = shown_part(diagnosis)
    parts = [*(map_part(p, units.length) for p in places), *([] if shown is None else [shown])]
    parts.append(waterfall_part(diagnosis))
    panels = effect_panels(diagnosis)
    parts += [driver_part(panel) for panel in panels]
    parts += [shape_part(shape, units) for shape in diagnosis.shapes]
    if diagnosis.findings:
        parts.append(rivals_part(diagnosis))
    error_words = [errors_in_words(places)] if places else []
    error_words += [] if shown is None else [_residuals_in_words(diagnosis)]
    words = [*error_words, *(panel_in_words(p) for p in panels), *(shape_in_words(s) for s in diagnosis.shapes)]
    return composed("diagnosis", titles, " ".join(words), parts)


def diagnosed_places(diagnosis: Diagnosis) -> list[PlaneErrors]:
    """Positions and errors, calibrated and with the effects found; none without positions."""
    return places_of(diagnosis.problem, _stages(diagnosis))


def _stages(diagnosis: Diagnosis) -> list[tuple[str, Array]]:
    """Residuals (N, C), calibrated and with the effects found."""
    stages = [(_CALIBRATED, diagnosis.before.after.residual)]
    if diagnosis.findings or diagnosis.shapes:
        stage = _WITH if diagnosis.findings else _SHAPED
        stages.append((stage, diagnosis.search.fit.after.residual))
    return stages


def shown_part(diagnosis: Diagnosis) -> Part | None:
    """Residuals of the kind whose errors are told, over the drives; None of positions, which have their own map."""
    shown, channels = diagnosis.shown, diagnosis.problem.model.channels
    if channels[shown.channels[0]].measurand is Measurand.POSITION or not diagnosis.problem.model.actuators:
        return None
    return kind_part(diagnosis.problem, shown.name, shown.channels, _stages(diagnosis))


def _residuals_in_words(diagnosis: Diagnosis) -> str:
    return f"Residuals of {diagnosis.shown.name} over the reading of each drive."


def effect_panels(diagnosis: Diagnosis) -> list[DriverPanel]:
    """Panels of all findings that have one."""
    panels = (driver_panel(diagnosis, finding) for finding in diagnosis.findings)
    return [panel for panel in panels if panel is not None]


def is_circle(at: Array) -> bool:
    """Whether positions (N, 2) lie on a circle."""
    radius = np.linalg.norm(at - 0.5 * (at.min(axis=0) + at.max(axis=0)), axis=1)
    return bool(len(at) >= 12 and radius.std() < _ROUND * radius.mean())


# --- circular run ----------------------------------------------------------------------------
def circle_picture(places: PlaneErrors, titles: Titles, length: Unit, name: str) -> Picture:
    """Radial errors of a circular run, by stage, magnified."""
    middle = 0.5 * (places.at.min(axis=0) + places.at.max(axis=0))
    ray = places.at - middle
    radius = np.linalg.norm(ray, axis=1)
    radial = [(n, (errors * ray).sum(axis=1) / radius) for n, errors in places.stages]
    labels = [f"{n} {size_text(float(np.sqrt((r**2).mean())))} rms" for n, r in radial]
    caption = f"radial error, radius {radius.mean() / length.scale:.4g} {length.text}"

    def draw(figure: Figure) -> None:
        titles.write(figure)
        size = figure.get_size_inches()
        ax: Any = figure.add_axes((0.12, 0.1, 0.76, 1 - 0.1 - 1.25 / size[1]), projection="polar")
        largest = max(float(np.abs(radial[0][1]).max()), 1e-12)
        for (_, errors), text, colour, marker in zip(radial, labels, (BEFORE, AFTER), "os", strict=False):
            angle = np.arctan2(ray[:, 1], ray[:, 0])
            ax.plot(angle, 3 * largest + errors, ls="none", marker=marker, ms=3, color=colour, label=text)
        ax.set_yticks([2 * largest, 3 * largest, 4 * largest])
        ax.set_yticklabels([f"-{size_text(largest)}", "0", f"+{size_text(largest)}"], fontsize=8)
        ax.set_rlabel_position(11)
        figure.text(0.5, 1 - 0.62 / size[1], caption, ha="center", va="top", size=9)
        figure.legend(loc="lower center", ncols=2, fontsize=8, frameon=False)

    return Picture(name, f"{titles.machine}: {titles.subject}", f"{caption}: {', '.join(labels)}.", (6.0, 6.4), draw)


# --- effects ---------------------------------------------------------------------------------
def panel_in_words(panel: DriverPanel) -> str:
    """What a panel shows."""
    return f"{panel.finding.hypothesis.name}: {panel.quantity} over {panel.name}, measured and fitted."


def driver_part(panel: DriverPanel) -> Part:
    """What an effect explains over what drives it, with the fitted curve and its 95 % band.

    Where rows of other poses lie between, points have no curve through them: each has its own.
    """

    def draw(figure: SubFigure) -> None:
        ax = figure.add_subplot()
        unit = panel.displaced_in
        y, fitted = panel.measured / unit.scale, panel.fitted / unit.scale
        for side, colour, marker, name in _sides(panel):
            _side(ax, panel, side, (colour, marker, name))
        outside = _limit(ax, y, fitted)
        beyond = f"; {outside} of {len(y)} points lie beyond" if outside else ""
        ax.set_xlabel(f"{plain(panel.name)} [{panel.unit_name}]{beyond}")
        ax.set_ylabel(f"{panel.quantity} [{unit.text}]")
        ax.set_title(plain(panel.title), fontsize=9)
        ax.legend(fontsize=8, loc="center left", bbox_to_anchor=(1.01, 0.5), frameon=False)

    return Part(3.0, draw)


def _sides(panel: DriverPanel) -> Iterator[tuple[int, str, str, str]]:
    """Sides of approach that occur: sign, colour, marker, name."""
    sides = np.zeros(len(panel.x)) if panel.side is None else np.sign(panel.side)
    every = ((-1, BEFORE, "o", "from above"), (0, AFTER, "s", "measured"), (1, AFTER, "s", "from below"))
    return (s for s in every if (sides == s[0]).any())


def _side(ax: Axes, panel: DriverPanel, side: int, look: tuple[str, str, str]) -> None:
    """Points of one side of approach and what is fitted to them."""
    colour, marker, name = look
    sides = np.zeros(len(panel.x)) if panel.side is None else np.sign(panel.side)
    rows = np.nonzero(sides == side)[0]
    rows = rows[np.argsort(panel.shown_x[rows], kind="stable")]
    unit = panel.displaced_in
    x, y, noise, fitted, band = (
        v[rows] / s for v, s in
        ((panel.shown_x, 1.0), *((v, unit.scale) for v in (panel.measured, panel.noise, panel.fitted, panel.band)))
    )  # fmt: skip
    ax.errorbar(x, y, noise, fmt=marker, ms=3, lw=0.5, color=colour, mfc="white", label=f"{name}, one sigma", zorder=2)
    first = side == next(_sides(panel))[0]
    if not panel.curve:
        label = "fitted" if first else None
        ax.plot(x, fitted, ls="none", marker="_", ms=7, mew=1.4, color=FITTED, label=label, zorder=3)
        return
    ax.plot(x, fitted, "-", color=FITTED, lw=1.2, label="fitted, 95 %" if first else None, zorder=3)
    ax.fill_between(x, fitted - band, fitted + band, color=FITTED, alpha=0.15, lw=0)


def _limit(ax: Axes, y: Array, fitted: Array) -> int:
    """Limits to what most rows show; those that see little of the effect are noisy. Returns how many lie beyond."""
    low, high = np.quantile(y, [0.02, 0.98])
    low, high = min(low, fitted.min()), max(high, fitted.max())
    room = 0.15 * (high - low) or 1.0
    ax.set_ylim(low - room, high + room)
    return int(((y < low - room) | (y > high + room)).sum())


# --- steps -----------------------------------------------------------------------------------
def waterfall_part(diagnosis: Diagnosis) -> Part:
    """What is left of the residual, step by step, as dots on one axis that ends at the noise."""
    shares = waterfall(diagnosis)
    names, sizes = [shortened(plain(s.name), _NAME) for s in shares], np.array([s.noise for s in shares])

    def draw(figure: SubFigure) -> None:
        ax = figure.add_subplot()
        ax.set_ylim(len(names) - 0.5, -0.6)
        ax.set_xlim(0.7 * min(1.0, sizes.min()), 1.6 * max(1.0, sizes.max()))
        plain_log(ax)
        ax.axvline(1.0, color=NOISE, lw=1.2, ls="--")
        for k, size in enumerate(sizes):
            fitted = k >= min(2, len(sizes) - 1)
            ax.plot([1.0, size], [k, k], color="0.85", lw=1, zorder=1)
            colour, marker = (AFTER, "s") if fitted else (BEFORE, "o")
            ax.plot(size, k, marker=marker, ms=7, color=colour, ls="none", gid=f"step-{k}")
            ax.annotate(three_digits(size), (size, k), xytext=(7, 0), textcoords="offset points", va="center",
                        fontsize=8, bbox={"fc": "white", "ec": "none", "pad": 0.5})  # fmt: skip
        ax.set_yticks(range(len(names)), names)
        ax.grid(axis="y", visible=False)
        ax.set_xlabel("residuals, times the stated noise (root of chi-square per degree of freedom; logarithmic)")

    return Part(0.75 + 0.3 * len(names), draw)


# --- rivals ----------------------------------------------------------------------------------
def rivals_part(diagnosis: Diagnosis) -> Part:
    """One line for each effect found: the effect most similar to it, and how similar that is."""
    rivals = nearest_rivals(diagnosis)

    def draw(figure: SubFigure) -> None:
        ax = figure.add_subplot()
        ax.set_xlim(0, 1.02)
        ax.set_ylim(len(rivals) - 0.4, -0.6)
        for row, near in enumerate(rivals):
            colour, marker, face = (AFTER, "s", AFTER) if near.distinct else (BEFORE, "o", "white")
            ax.plot([0, near.cosine], [row, row], color="0.85", lw=1, zorder=1)
            ax.plot(near.cosine, row, marker=marker, ms=6, mfc=face, mec=colour, ls="none", gid=f"rival-{row}")
            left = near.cosine > 0.5
            text = f"{shortened(plain(near.rival), _NAME)}  {near.cosine:.2f}"
            ax.annotate(text, (near.cosine, row), xytext=(-8 if left else 8, 0),
                        textcoords="offset points", va="center", ha="right" if left else "left", fontsize=8,
                        bbox={"fc": "white", "ec": "none", "pad": 0.5})  # fmt: skip
        ax.set_yticks(range(len(rivals)), [shortened(plain(near.name), _NAME) for near in rivals])
        ax.grid(axis="y", visible=False)
        ax.set_xlabel("effect found, and the one most similar to it: cosine between them (open: not told apart here)")

    return Part(0.75 + 0.3 * max(len(rivals), 1), draw)
