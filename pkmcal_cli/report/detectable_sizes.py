"""How large effects must be to be seen, in words and as JSON: by one test, by all of them, in the worst direction."""

from __future__ import annotations

from typing import Any

import numpy as np

from pkmcal_cli.base.rotation import Array
from pkmcal_cli.diagnosis.visible_sizes import SizeAlong, VisibleSizes
from pkmcal_cli.model.model import Model
from pkmcal_cli.report.number_format import NEVER, detectable_size, finite, handy
from pkmcal_cli.report.parameters import parameter_unit

_PART = 0.15  # share of the largest number of a direction, from which on one is told
_WORSE = 1.5  # times the size of the leading number alone: from there on the worst direction is told


def sizes_text(model: Model, sizes: VisibleSizes) -> tuple[str, str]:
    """Of the leading number: smallest detectable size, and size that is detected in 80 %."""
    unit = parameter_unit(model, sizes.parameter)
    one, whole = (detectable_size(x, sizes.plausible, unit) for x in (sizes.mdb, sizes.detected))
    return one, whole


def worst_text(model: Model, sizes: VisibleSizes) -> str:
    """The direction among an effect's numbers in which it must be largest; "" where that is hardly any difference."""
    worst, leading = sizes.worst, sizes.numbers[sizes.leading]
    if worst is None or not sizes.tested or worst.detected < _WORSE * leading.detected:
        return ""
    if worst.detected < NEVER:
        return f"{_parts(model, sizes, worst.direction * worst.detected)} at worst"
    why = f", taken up by {', '.join(worst.absorbed_by)}" if worst.absorbed_by else ""
    return f"never along {_names(sizes, worst.direction)}{why}"


def _parts(model: Model, sizes: VisibleSizes, vector: Array) -> str:
    """The numbers of a vector (p,), in standard deviations of their priors, that matter."""
    names = sizes.hypothesis.parameters
    parts = [j for j in np.argsort(-np.abs(vector)) if abs(vector[j]) >= _PART * np.abs(vector).max()]
    return ", ".join(
        f"{_last_part(names[j])} {handy(float(vector[j] * sizes.scale[j]), parameter_unit(model, names[j]))}"
        for j in parts
    )


def _names(sizes: VisibleSizes, direction: Array) -> str:
    """The numbers that take part in a direction, with their shares."""
    share = direction / np.abs(direction).max()
    parts = [j for j in np.argsort(-np.abs(share)) if abs(share[j]) >= _PART]
    if len(parts) == 1:
        return _last_part(sizes.hypothesis.parameters[parts[0]])
    return ", ".join(f"{share[j]:+.2g} {_last_part(sizes.hypothesis.parameters[j])}" for j in parts)


def _last_part(parameter: str) -> str:
    """The last part of a parameter's name."""
    return parameter.rpartition(".")[2]


def sizes_json(model: Model, sizes: VisibleSizes) -> dict[str, Any]:
    """The same as plain values."""
    unit, worst = parameter_unit(model, sizes.parameter), sizes.worst
    numbers = [_number_json(model, sizes, j, along) for j, along in sizes.numbers.items()]
    return {
        "effect": sizes.hypothesis.effect,
        "at": sizes.hypothesis.at,
        "parameter": sizes.parameter,
        "mdb": finite(sizes.mdb / unit.scale),
        "detected": finite(sizes.detected / unit.scale),
        "unit": unit.text,
        "numbers": numbers,
        "worst": None if worst is None else _worst_json(model, sizes, worst),
    }


def _number_json(model: Model, sizes: VisibleSizes, j: int, along: SizeAlong) -> dict[str, Any]:
    name = sizes.hypothesis.parameters[j]
    unit = parameter_unit(model, name)
    size = float(sizes.scale[j]) / unit.scale
    return {"name": name, "mdb": finite(along.mdb * size), "detected": finite(along.detected * size), "unit": unit.text}


def _worst_json(model: Model, sizes: VisibleSizes, worst: SizeAlong) -> dict[str, Any]:
    """The direction at the size of one standard deviation of its prior, and sizes in such."""
    names, steps = sizes.hypothesis.parameters, worst.direction * sizes.scale
    parts = {
        n: finite(float(x) / parameter_unit(model, n).scale) for n, x in zip(names, steps, strict=True) if x != 0.0
    }
    return {
        "direction": parts,
        "mdb": finite(worst.mdb),
        "detected": finite(worst.detected),
        "absorbed_by": list(worst.absorbed_by),
    }
