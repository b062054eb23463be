"""What goes wrong in a machine file: keys, values, units, entries, lists, changed where they stand in the text."""

from __future__ import annotations

import random
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import yaml

VALUES = (
    "", "~", "null", "true", "no", "yes", "012", "0x1F", "0o17", "1_000", "1e3", "1E+3", "1e400", "1e-400", ".inf",
    "nan", ".nan", "1,5", "1.5.2", "12:30", "-1", "0", "-0", "+3", "1e39", "1e41", "9" * 310, "'5'", "\"5\"", "5 mm",
    "5mm", "5 um", "5 deg", "5 kN", "5 mN", "5 m", "5 in", "5 N/mm", "5 kN/mm", "5 Mm", "5 parsec", "5%", "5 ppm",
    "[1, 2]", "[]", "{}", "{a: 1}", "x", "tcp", "2*3", "1/0", "sqrt(4)", "sqrt(-1)", "l1", "l1 + 1", "-l1", "l1/k1",
    "(1", "1)", "2 +", "2**3**4", "9**9**9", "{i}", "\"{i}\"", "*a", "&a 1", "!!str 5", "!x 5", "!!python/none 5",
    "@x", "%x", "`x`", "- 1", "|", ">", "a: b", "# c", "2021-12-16", "1 # c", "1 mm # c", "'l1", "\u00b5",
    "5 \u00b5m", "\u0665",
)  # fmt: skip
UNITS = (
    "mm", "m", "um", "in", "deg", "rad", "arcsec", "N", "kN", "N/mm", "kN/mm", "N/m", "kg", "g", "GPa", "1", "",
    "MPa", "step", "mm/mm",
)  # fmt: skip
KEYS = (
    "nominal", "range", "unit", "k", "length", "at", "between", "sigma", "mass", "note", "identify", "guide", "each",
    "EA", "zero", "scale",
)  # fmt: skip
TYPED = ("", "x", "{", "]", ": ", ",", "-", "9", "\n", "'", "\t", "#", "\u00b5", "&a ", "*a")


@dataclass(frozen=True)
class Spot:
    """A place in the text: start and end of a value, of its key (or -1), whether it is a scalar."""

    start: int
    end: int
    key: int
    key_end: int
    scalar: bool


def spots(text: str) -> list[Spot]:
    """All values of a file."""
    return list(_spots(yaml.compose(text, Loader=yaml.SafeLoader), None))


def _spots(node: Any, key: Any) -> Iterator[Spot]:
    span = (key.start_mark.index, key.end_mark.index) if key is not None else (-1, -1)
    scalar = isinstance(node, yaml.ScalarNode)
    if scalar or getattr(node, "flow_style", False):
        yield Spot(node.start_mark.index, node.end_mark.index, *span, scalar)
    for part in node.value if not scalar else ():
        if isinstance(node, yaml.MappingNode):
            yield from _spots(part[1], part[0])
        else:
            yield from _spots(part, None)


def _number_slip(old: str, rng: random.Random) -> str:
    """A number written otherwise, or a slip in it."""
    at = rng.randrange(len(old)) if old else 0
    bare = old.partition(" ")[0]
    typed = rng.choice("0123456789.,-e+ *")
    forms = [f"-{old}", f"{old}0", f"{old}e3", f"{old}.0", f"{bare} {rng.choice(UNITS)}", f"{bare}{rng.choice(UNITS)}",
             bare, old[:at] + old[at + 1 :], old[:at] + typed + old[at:], f"'{old}'", f"{old} + 0", f"2*{bare}",
             f"({old})", f" {old} "]  # fmt: skip
    return rng.choice(forms)


def mutate(text: str, places: list[Spot], rng: random.Random) -> str:
    """One mutation, or two, from the back to the front; every other one in a number."""
    if rng.random() < 0.5:
        spot = rng.choice([s for s in places if s.scalar and text[s.start] in "0123456789-."])
        return text[: spot.start] + _number_slip(text[spot.start : spot.end], rng) + text[spot.end :]
    chosen = rng.sample(places, rng.choice((1, 1, 2)))
    for spot in sorted(chosen, key=lambda s: -s.start):
        text = _mutated(text, spot, places, rng)
    if rng.random() < 0.1:
        at, put = rng.randrange(len(text)), rng.choice(TYPED)
        text = text[:at] + put + text[at + rng.choice((0, 1, 5)) :]
    return text


def _mutated(text: str, spot: Spot, places: list[Spot], rng: random.Random) -> str:
    kind, old, named = rng.randrange(9), text[spot.start : spot.end], spot.key >= 0
    if kind in (0, 1) and spot.scalar:
        return text[: spot.start] + _number_slip(old, rng) + text[spot.end :]
    if kind == 2:
        other = rng.choice(places)
        return text[: spot.start] + text[other.start : other.end] + text[spot.end :]
    if kind == 3 and named:
        name = text[spot.key : spot.key_end]
        at = rng.randrange(len(name) + 1)
        slips = (name[:at] + name[at + 1 :], f"{name[:at]}x{name[at:]}", name.upper(), rng.choice(KEYS), f"{name}2")
        new = rng.choice(slips)
        return text[: spot.key] + new + text[spot.key_end :]
    if kind == 4:
        begin = spot.key if named else spot.start
        end = spot.end + (2 if text[spot.end : spot.end + 2] == ", " else 0)
        return text[:begin] + text[end:]
    if kind == 5 and named:
        pair = text[spot.key : spot.end]
        again = pair if rng.random() < 0.3 else pair.replace(text[spot.key : spot.key_end], rng.choice(KEYS), 1)
        line = text.rfind("\n", 0, spot.key) + 1
        joint = "\n" + " " * (spot.key - line) if not text[line : spot.key].strip() else ", "
        return text[: spot.end] + joint + again + text[spot.end :]
    if kind == 6 and not named:
        return text[: spot.start] + f"{old}, {old}" + text[spot.end :]
    return text[: spot.start] + rng.choice(VALUES) + text[spot.end :]
