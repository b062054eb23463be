"""Sizes of parameters on the command line, `--size "30 um"` or `--size "k*=10 kN/mm"`, in place of their ranges."""

from __future__ import annotations

from collections.abc import Sequence
from fnmatch import fnmatchcase

from pkmcal_cli.base.errors import UsageError, did_you_mean
from pkmcal_cli.model.model import Model
from pkmcal_cli.units.unit_text import parse_unit
from pkmcal_cli.workflow.amounts import amount, require_unit


def stated_sizes(model: Model, selected: Sequence[str], texts: Sequence[str]) -> dict[str, float]:
    """Size of each selected parameter, SI: the last stated one that names it or fits its dimension, else its range.

    Raises UsageError for sizes that are none, or that no selected parameter takes.
    """
    units = {p.name: parse_unit(p.unit or "1") for p in model.parameters if p.name in selected}
    sizes = {p.name: p.range for p in model.parameters if p.name in units}
    for text in texts:
        pattern, equals, value = (part.strip() for part in text.rpartition("="))
        size, unit = amount("--size", value)
        if size <= 0:
            raise UsageError(f"--size: `{text}` is not above zero", hint='write, e.g., --size "30 um"')
        matching = [n for n in units if fnmatchcase(n, pattern)] if equals else list(units)
        if not matching:
            raise UsageError(f"--size: no selected parameter `{pattern}`", hint=did_you_mean(pattern, units))
        fitting = [n for n in matching if units[n].dimension == unit.dimension]
        if not fitting or (equals and len(fitting) < len(matching)):
            other = next(n for n in matching if n not in fitting)
            require_unit("--size", text, unit, units[other])
            message = f"--size: `{text}`: {unit.text} does not fit " + (f"`{other}`" if equals else "any parameter")
            raise UsageError(message, hint=f"`{other}` is in {units[other].text}")
        sizes |= dict.fromkeys(fitting, size)
    return {name: sizes[name] for name in selected}
