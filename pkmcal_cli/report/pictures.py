"""Pictures of a diagnosis as SVG files. They need matplotlib, of the extra `report`."""

from __future__ import annotations

import os
from collections.abc import Callable, Collection, Iterator
from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np

from pkmcal_cli.base.errors import UsageError
from pkmcal_cli.base.outputs import check_target, make_folder, write_text
from pkmcal_cli.base.rotation import Array
from pkmcal_cli.diagnosis.panels import DriverPanel, alike, driver_panel, waterfall
from pkmcal_cli.diagnosis.run_diagnosis import Diagnosis
from pkmcal_cli.language.machine import Machine
from pkmcal_cli.units.measurands import Measurand
from pkmcal_cli.units.unit_text import UNITS, Unit

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

_BEFORE, _AFTER, _CURVE = "#b04a3a", "#2f6f9f", "#111111"
_ARROW = 0.08  # length of the typical arrow, of the region's width
_ROUND = 0.02  # spread of the radius below which poses lie on a circle


@dataclass(frozen=True)
class Places:
    """Measured positions (N, 2) and errors before and after (N, 2), SI, in one plane; sigma of a position."""

    plane: str
    at: Array
    before: Array
    after: Array
    sigma: float


def check_library() -> None:
    """Raises UsageError where there is nothing to draw with."""
    try:
        import matplotlib.figure  # noqa: F401
    except ImportError:
        raise UsageError(
            "--plots DIR needs matplotlib", hint="run `pip install 'pkmcal[report]'`, or use `--plots -`"
        ) from None


def write_pictures(folder: str, machine: Machine, diagnosis: Diagnosis, inputs: Collection[str]) -> list[str]:
    """Write all pictures into a folder, over none of the inputs; returns the files. Raises UsageError, OutputError."""
    check_library()
    from matplotlib import rc_context
    from matplotlib.figure import Figure

    make_folder(folder)
    pictures = {os.path.join(folder, f"{name}.svg"): (size, draw) for name, size, draw in _pictures(machine, diagnosis)}
    for file in pictures:
        check_target(file, inputs, force=True)
    style: Any = {"svg.fonttype": "none", "svg.hashsalt": "pkmcal", "font.size": 9}
    style |= {"axes.grid": True, "grid.alpha": 0.3}
    with rc_context(style):
        for file, (size, draw) in pictures.items():
            figure = Figure(figsize=size, layout="constrained")
            draw(figure)
            with write_text(file, inputs, force=True) as text:
                figure.savefig(text, format="svg", metadata={"Date": None})
    return list(pictures)


Picture = tuple[str, tuple[float, float], Callable[["Figure"], Any]]


def _pictures(machine: Machine, diagnosis: Diagnosis) -> Iterator[Picture]:
    length = machine.file_units.length
    for places in planes(diagnosis):
        yield f"errors-{places.plane}", (9.0, 5.0), partial(_quiver, places=places, length=length)
        if _is_circle(places.at):
            yield f"circle-{places.plane}", (5.0, 5.0), partial(_circle, places=places, length=length)
    for finding in diagnosis.findings:
        panel = driver_panel(diagnosis, finding)
        if panel is not None:
            yield f"effect-{finding.hypothesis.name}", (7.0, 4.2), partial(_driver, panel=panel)
    yield "variance", (7.0, 3.0), partial(_waterfall, diagnosis=diagnosis)
    if diagnosis.findings:
        yield "ambiguity", (6.4, 5.6), partial(_alike, diagnosis=diagnosis)


def planes(diagnosis: Diagnosis) -> list[Places]:
    """Positions and errors of the first three position channels, plane by plane; none without positions."""
    problem = diagnosis.problem
    channels = problem.model.measuring(Measurand.POSITION)[:3]
    whole = problem.measured[:, channels].all(axis=1)
    if len(channels) < 2 or not whole.any():
        return []
    at = problem.readings[whole][:, channels]
    before, after = (e.residual[whole][:, channels] for e in (diagnosis.before.after, diagnosis.search.fit.after))
    sigma = float(np.sqrt((problem.sigma[whole][:, channels] ** 2).mean()))
    pairs = [(0, 1)] if len(channels) == 2 else [(0, 1), (0, 2)]
    return [Places("xyz"[a] + "xyz"[b], at[:, [a, b]], before[:, [a, b]], after[:, [a, b]], sigma) for a, b in pairs]


def _quiver(figure: Figure, places: Places, length: Unit) -> None:
    """Errors before and after as arrows, both at the scale of the former."""
    at = places.at / length.scale
    width = float(np.ptp(at, axis=0).max())
    typical = float(np.sqrt((places.before**2).sum(axis=1).mean())) / length.scale
    factor = _ARROW * width / typical
    axes = figure.subplots(1, 2, sharex=True, sharey=True)
    for ax, errors, title, colour in zip(
        axes, (places.before, places.after), ("calibrated", "with effects found"), (_BEFORE, _AFTER), strict=True
    ):
        moved = errors / length.scale * factor
        ax.quiver(*at.T, *moved.T, angles="xy", scale_units="xy", scale=1, width=0.004, color=colour)
        rms = np.sqrt((errors**2).sum(axis=1).mean())
        ax.margins(0.15)
        ax.set_title(f"{title}: {_size(rms)} rms")
        ax.set_aspect("equal")
        ax.set_xlabel(f"{places.plane[0]} [{length.text}]")
    axes[0].set_ylabel(f"{places.plane[1]} [{length.text}]")
    corner = at.min(axis=0) - 0.06 * width
    axes[0].quiver(*corner, _ARROW * width, 0, angles="xy", scale_units="xy", scale=1, width=0.006, color=_CURVE)
    axes[0].annotate(_size(typical * length.scale), corner, xytext=(0, 6), textcoords="offset points", fontsize=8)
    from matplotlib.patches import Circle

    spot = corner + np.array([0.3 * width, 0])
    axes[0].add_patch(Circle(tuple(spot), 2 * places.sigma / length.scale * factor, fill=False, color="#777777"))
    axes[0].annotate("2 sigma", tuple(spot), xytext=(8, 6), textcoords="offset points", fontsize=8)


def _is_circle(at: Array) -> bool:
    radius = np.linalg.norm(at - 0.5 * (at.min(axis=0) + at.max(axis=0)), axis=1)
    return bool(len(at) >= 12 and radius.std() < _ROUND * radius.mean())


def _circle(figure: Figure, places: Places, length: Unit) -> None:
    """Radial errors of a circular run, before and after, magnified."""
    middle = 0.5 * (places.at.min(axis=0) + places.at.max(axis=0))
    ray = places.at - middle
    radius = np.linalg.norm(ray, axis=1)
    angle = np.arctan2(ray[:, 1], ray[:, 0])
    ax = figure.add_subplot(projection="polar")
    largest = float(np.abs((places.before * ray).sum(axis=1) / radius).max())
    for errors, label, colour in ((places.before, "calibrated", _BEFORE), (places.after, "with effects", _AFTER)):
        radial = (errors * ray).sum(axis=1) / radius
        rms = float(np.sqrt((radial**2).mean()))
        ax.plot(angle, 3 * largest + radial, ".", ms=4, color=colour, label=f"{label}, {_size(rms)} rms")
    ax.set_yticks([2 * largest, 3 * largest, 4 * largest])
    ax.set_yticklabels([f"-{_size(largest)}", "0", f"+{_size(largest)}"], fontsize=7)
    ax.set_title(f"radial error, radius {radius.mean() / length.scale:.4g} {length.text}")
    ax.legend(loc="lower right", fontsize=7)


def _driver(figure: Figure, panel: DriverPanel) -> None:
    """What an effect explains over what drives it, with the fitted curve and its 95 % band."""
    ax = figure.add_subplot()
    unit = panel.displaced_in
    y, noise, fitted, band = (v / unit.scale for v in (panel.measured, panel.noise, panel.fitted, panel.band))
    x, sides = panel.shown_x, np.zeros(len(panel.x)) if panel.side is None else panel.side
    for side, colour, name in ((-1, _BEFORE, "from above"), (0, _AFTER, "measured"), (1, _AFTER, "from below")):
        this_way = np.sign(sides) == side
        if this_way.any():
            ax.errorbar(
                x[this_way],
                y[this_way],
                noise[this_way],
                fmt=".",
                ms=4,
                lw=0.5,
                color=colour,
                label=f"{name}, one sigma",
            )
            this_way = np.nonzero(this_way)[0][np.argsort(x[this_way])]
            ax.plot(
                x[this_way], fitted[this_way], "-", color=_CURVE, lw=1.2, label=None if side < 0 else "fitted, 95 %"
            )
            low, high = fitted[this_way] - band[this_way], fitted[this_way] + band[this_way]
            ax.fill_between(x[this_way], low, high, color=_CURVE, alpha=0.15, lw=0)
    _limit(ax, y, fitted)
    ax.set_xlabel(f"{panel.name} [{panel.unit_name}]")
    ax.set_ylabel(f"displacement [{unit.text}]")
    ax.set_title(panel.finding.hypothesis.name)
    ax.legend(fontsize=7)


def _limit(ax: Axes, y: Array, fitted: Array) -> None:
    """Rows that see little of the effect are noisy: the picture shows what the others show."""
    low, high = np.quantile(y, [0.02, 0.98])
    low, high = min(low, fitted.min()), max(high, fitted.max())
    ax.set_ylim(low - 0.15 * (high - low), high + 0.15 * (high - low))


def _waterfall(figure: Figure, diagnosis: Diagnosis) -> None:
    """What is left of the variance, step by step, against noise."""
    ax = figure.add_subplot()
    shares = waterfall(diagnosis)
    names, sizes = [s.name for s in shares], [s.rms for s in shares]
    ax.barh(names, sizes, color=[_BEFORE] * 2 + [_AFTER] * (len(names) - 2))
    for k, size in enumerate(sizes):
        ax.annotate(f"{size:.3g}", (size, k), xytext=(3, -3), textcoords="offset points", fontsize=8)
    ax.axvline(1.0, color=_CURVE, lw=1, ls="--", label="noise")
    ax.set_xscale("log")
    ax.invert_yaxis()
    ax.set_xlabel("rms of the residual, in standard uncertainties")
    ax.legend(fontsize=8)


def _alike(figure: Figure, diagnosis: Diagnosis) -> None:
    """Cosines of the angles between the effects found and their nearest rivals."""
    names, cosines = alike(diagnosis)
    ax = figure.add_subplot()
    ax.grid(False)
    image = ax.imshow(cosines, cmap="Blues", vmin=0, vmax=1)
    ax.set_xticks(range(len(names)), names, rotation=90, fontsize=7)
    ax.set_yticks(range(len(names)), names, fontsize=7)
    for i, row in enumerate(cosines):
        for j, c in enumerate(row):
            ax.text(j, i, f"{c:.2f}", ha="center", va="center", fontsize=6, color="white" if c > 0.6 else "black")
    figure.colorbar(image, label="cosine (above 0.95: not separable)")
    ax.set_title("effects found and those most similar to them")


def _size(value: float) -> str:
    """A length in the unit that suits it."""
    unit = UNITS["mm" if value >= 1e-3 else "um"]
    return f"{value / unit.scale:.3g} {unit.text}"
