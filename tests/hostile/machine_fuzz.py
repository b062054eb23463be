"""Mutated machine files through the program's reader, against the plain one: nothing lost, no number another one."""

from __future__ import annotations

import math
import random
from collections.abc import Iterator
from functools import cache
from pathlib import Path as File
from typing import Any

from pkmcal_cli.base.errors import BadInput
from pkmcal_cli.language.machine import Machine
from pkmcal_cli.language.machine_yaml import read_machine
from pkmcal_cli.language.quantities import Quantity
from tests.command import MACHINES
from tests.hostile.plain_machine import Path, Tree, Unsure, bare_scale, leaves, number, plain_tree, tree_by_sections
from tests.hostile.plain_units import Powers, unit
from tests.hostile.yaml_slips import Spot, mutate, spots

BASES = {"biglide": 3, "triglide": 3, "five-bar": 2, "gantry": 1}  # the longer, the rarer
_CLOSE = 1e-12
_MISSING = object()


@cache
def base(name: str) -> tuple[str, list[Spot]]:
    """A shipped machine file, and the places of its values."""
    text = (MACHINES / f"{name}.yaml").read_text(encoding="utf-8")
    return text, spots(text)


def judged(seed: int, folder: File) -> tuple[str, str]:
    """A mutated machine file: (outcome, what is wrong with it, "" if nothing)."""
    rng = random.Random(seed)
    text, places = base(rng.choices(list(BASES), list(BASES.values()))[0])
    text = mutate(text, places, rng)
    file = folder / "m.yaml"
    file.write_text(text, encoding="utf-8")
    try:
        machine = read_machine(file)
    except BadInput as error:
        return ("refused", "") if error.text().strip() else ("nothing told", "an error without a text")
    for reader in (tree_by_sections, plain_tree):  # the first is quick, the second has the last word
        try:
            wrong = next(differences(machine, reader(text)), "")
            outcome = "silent shift" if wrong else "agreed"
        except Unsure as error:
            outcome, wrong = "read what is unsure", str(error)
        if not wrong:
            break
    return outcome, wrong


def differences(machine: Machine, tree: Tree) -> Iterator[str]:
    """What the program read otherwise, or not at all."""
    for path, text in leaves(tree):
        found = _at(machine, path)
        if found is _MISSING:
            yield f"{path}: {text} is lost"
        elif isinstance(found, Quantity):
            yield from _number_differs(machine, tree, path, text, found)
        elif isinstance(found, float) and path[0] == "parameters":
            yield from _parameter_differs(machine, tree, path, text, found)
        elif isinstance(found, str) and found.replace("\t", " ") != text.replace("\t", " "):  # as `_composed` has them
            yield f"{path}: {found}, not {text}"


def _at(value: Any, path: Path) -> Any:
    """What the machine has at a path of the file, `_MISSING` where that is nothing."""
    for key in path:
        if isinstance(value, dict):
            if isinstance(key, int):
                return None  # written in a short form
            value = value.get(key, _MISSING)
        elif isinstance(value, tuple):
            if not isinstance(key, int):
                return None  # written in a short form
            value = value[key] if key < len(value) else _MISSING
        elif isinstance(value, Quantity | str | int | float | None):
            return None  # written in a longer form
        else:
            value = getattr(value, str(key), None if isinstance(key, int) else _MISSING)
        if value is _MISSING or value is None:
            return value
    return value


def _powers(quantity: Any) -> Powers:
    return tuple(int(p) for p in quantity.exponents)  # type: ignore[return-value]


def _number_differs(machine: Machine, tree: Tree, path: Path, text: str, found: Quantity) -> Iterator[str]:
    read = number(text)
    if read is None:
        return
    value = found.number(machine.nominal_values())
    yield from _differs(path, text, value, expected(read, _powers(found.dimension), tree))


def _parameter_differs(machine: Machine, tree: Tree, path: Path, text: str, found: float) -> Iterator[str]:
    read, parameter = number(text), machine.parameters[str(path[1])]
    if read is None:
        return
    stated = tree["parameters"][path[1]] if isinstance(tree, dict) else None
    own = stated.get("unit") if isinstance(stated, dict) else None
    if own and not read[1]:
        read = (read[0], own)
    yield from _differs(path, text, found, expected(read, _powers(parameter.dimension), tree))


def expected(read: tuple[float, str], powers: Powers, tree: Tree) -> float:
    """The number in SI; NaN where the unit is of another dimension. Raises Unsure for a unit that nobody knows."""
    if not read[1]:
        return read[0] * bare_scale(powers, tree)
    found = unit(read[1])
    if found is None:
        raise Unsure(f"unit {read[1]}")
    plain = [p[:3] + p[4:] for p in (found[1], powers)]
    compound = sum(map(abs, plain[0])) > 0 and plain[0] == plain[1]
    return read[0] * found[0] if found[1] == powers or compound else math.nan


def _differs(path: Path, text: str, found: float, right: float) -> Iterator[str]:
    if not abs(found - right) <= _CLOSE * abs(right):
        yield f"{path}: {text} is read as {found}, not {right}"
