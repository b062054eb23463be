"""Pictures of a diagnosis in characters, for terminals."""

from __future__ import annotations

import numpy as np

from pkmcal_cli.base.rotation import Array
from pkmcal_cli.diagnosis.panels import DriverPanel, driver_panel
from pkmcal_cli.diagnosis.run_diagnosis import Diagnosis
from pkmcal_cli.diagnosis.waterfall import waterfall
from pkmcal_cli.report.console import bar

_WIDTH, _HEIGHT = 64, 15
_DOT, _BELOW, _CURVE = "o", "+", "*"


def text_pictures(diagnosis: Diagnosis) -> str:
    """The residual step by step, and every accepted effect over what drives it."""
    parts = [_bars(diagnosis)]
    parts += [_panel(p) for f in diagnosis.findings if (p := driver_panel(diagnosis, f)) is not None]
    return "\n".join(["", "\n\n".join(parts)])


def _bars(diagnosis: Diagnosis) -> str:
    """What is left, as bars over the logarithm of its size."""
    shares = waterfall(diagnosis)
    width = max(len(s.name) for s in shares)
    most = max(np.log(max(s.noise for s in shares)), 1e-9)
    lines = ["residuals, times the stated noise, logarithmic (1: noise)"]
    lines += [f"{s.name:<{width}}  {s.noise:8.3g}  {bar(max(np.log(s.noise), 0.0) / most)}".rstrip() for s in shares]
    return "\n".join(lines)


def _panel(panel: DriverPanel) -> str:
    """Measured and fitted displacement over what drives it."""
    unit = panel.displaced_in
    y, fitted = panel.measured / unit.scale, panel.fitted / unit.scale
    low, high = np.quantile(y, [0.02, 0.98])
    low, high = min(float(low), float(fitted.min())), max(float(high), float(fitted.max()))
    x = panel.shown_x
    grid = np.full((_HEIGHT, _WIDTH), " ")
    below = np.zeros(len(x), dtype=bool) if panel.side is None else panel.side > 0
    for rows, values, mark in ((~below, y, _DOT), (below, y, _BELOW), (np.ones(len(x), bool), fitted, _CURVE)):
        inside = rows & (values >= low) & (values <= high)
        grid[_cell(values[inside], high, low, _HEIGHT), _cell(x[inside], x.min(), x.max(), _WIDTH)] = mark
    texts = [f"{high:.3g}", *[""] * (_HEIGHT - 2), f"{low:.3g}"]
    width = max(len(t) for t in texts)
    legend = f"{_DOT} measured" if panel.side is None else f"{_DOT} from above, {_BELOW} from below"
    lines = [f"{panel.finding.hypothesis.name}: {panel.quantity} [{unit.text}]; {legend}, {_CURVE} fitted"]
    lines += [f"{t:>{width}} |{''.join(row)}" for t, row in zip(texts, grid, strict=True)]
    lines.append(f"{'':>{width}} +{'-' * _WIDTH}")
    lines.append(f"{'':>{width}}  {x.min():.4g} ... {x.max():.4g} {panel.name} [{panel.unit_name}]")
    return "\n".join(line.rstrip() for line in lines)


def _cell(values: Array, first: float, last: float, count: int) -> Array:
    """Cells of values between two ends."""
    share = (values - first) / (last - first) if last != first else np.zeros(len(values))
    return np.asarray(np.round(share * (count - 1)).astype(np.intp))
