"""A second reader of machine files: their tree as texts, and the numbers that are plainly there, in SI.

It shares no line with the program's reader: PyYAML's composer gives nodes, numbers and units are read anew. It has no
model of machines: which dimension a bare number has it is told by the unspoilt file.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterator, Mapping
from functools import lru_cache
from typing import Any

import yaml

from tests.hostile.plain_table import Unsure
from tests.hostile.plain_units import Powers, unit

_NUMBER = re.compile(
    r"\s*([+-]?(?:[0-9]+\.?[0-9]*|\.[0-9]+)(?:[eE][+-]?[0-9]+)?)\s*((?![eE][+-]?[0-9])[A-Za-zµμ°%].*)?", re.DOTALL
)
_SECTION = re.compile(r"^(?=\w)", re.MULTILINE)
_DEFAULT = {"length": "m", "angle": "rad", "force": "N", "mass": "kg", "time": "s", "temperature": "K"}

Tree = dict[str, Any] | list[Any] | str | None
Path = tuple[str | int, ...]


def plain_tree(text: str) -> Tree:
    """Maps, lists and texts of a file, `each` written out; None for nothing. Raises Unsure: no YAML, a key twice."""
    return _each(_composed(text))


def tree_by_sections(text: str) -> Tree:
    """The same of a file whose sections begin at the left edge, each read by itself, and only once.

    Raises Unsure where they cannot stand alone, as where a quote is open or an alias is of another section.
    """
    out: dict[str, Tree] = {}
    for part in _SECTION.split(text):
        read = _section(part)
        if not isinstance(read, dict | None) or (read and read.keys() & out.keys()):
            raise Unsure("no sections")
        out |= read or {}
    return _each(out)


@lru_cache(maxsize=2048)
def _section(text: str) -> Tree:
    return _composed(text)


def _composed(text: str) -> Tree:
    try:
        node = yaml.compose(text, Loader=yaml.SafeLoader)
    except (yaml.YAMLError, ValueError, RecursionError) as error:
        if "\t" in text:  # it may stand before a colon, which this reader does not know
            return _composed(text.replace("\t", " "))
        raise Unsure(str(error)) from error
    return _tree(node)


def _tree(node: Any) -> Tree:
    if isinstance(node, yaml.MappingNode):
        pairs = [(key.value, _tree(value)) for key, value in node.value if isinstance(key, yaml.ScalarNode)]
        if len({key for key, _ in pairs}) < len(node.value):
            raise Unsure("a key twice, or one that is no name")
        return dict(pairs)
    if isinstance(node, yaml.SequenceNode):
        return [_tree(each) for each in node.value]
    if node is None or (node.style is None and node.value in ("", "~", "null", "Null", "NULL")):
        return None
    return str(node.value)


def _each(tree: Tree, values: Mapping[str, str] | None = None) -> Tree:
    """Entries with `each` once for every value."""
    if isinstance(tree, str) and values:
        return re.sub(r"\{(\w+)\}", lambda found: values.get(found[1], found[0]), tree)
    if isinstance(tree, list):
        return [_each(part, values) for part in tree]
    if not isinstance(tree, dict):
        return tree
    out: dict[str, Tree] = {}
    for key, part in tree.items():
        for given in _rounds(part):
            inner = {k: v for k, v in part.items() if k != "each"} if given and isinstance(part, dict) else part
            known = {**(values or {}), **given}
            name = str(_each(key, known))
            if name in out:
                raise Unsure(f"{name} twice")
            out[name] = _each(inner, known)
    return out


def _rounds(part: Tree) -> list[dict[str, str]]:
    if not isinstance(part, dict) or "each" not in part:
        return [{}]
    lists = part["each"]
    if not isinstance(lists, dict) or not all(isinstance(values, list) for values in lists.values()):
        raise Unsure("each")
    return [dict(zip(lists, row, strict=True)) for row in zip(*lists.values(), strict=False)]


def leaves(tree: Tree, path: Path = ()) -> Iterator[tuple[Path, str]]:
    """Every text of a tree with its path."""
    if isinstance(tree, dict):
        for key, part in tree.items():
            yield from leaves(part, (*path, key))
    elif isinstance(tree, list):
        for index, part in enumerate(tree):
            yield from leaves(part, (*path, index))
    elif tree is not None:
        yield path, tree


def number(text: str) -> tuple[float, str] | None:
    """A text "12 um" as number and unit text; None for expressions and names."""
    match = _NUMBER.fullmatch(text)
    if match is None or re.match(r"0[ox]", text) or not math.isfinite(float(match[1])):
        return None
    return float(match[1]), (match[2] or "").strip()


def bare_scale(powers: Powers, tree: Tree) -> float:
    """SI value of 1 where no unit is written, by the file's `units`. Raises Unsure."""
    stated = tree.get("units") if isinstance(tree, dict) else None
    texts = dict(_DEFAULT)
    texts.update({k: v for k, v in stated.items() if v} if isinstance(stated, dict) else {})
    scales = {}
    for key, text in texts.items():
        if (found := unit(text)) is None:
            raise Unsure(f"unit {text}")
        scales[key] = found[0]
    length, mass, time, _, _ = powers
    if powers == (1, 0, -2, 0, 0):
        return 1.0  # accelerations are always m/s^2
    if powers == (0, 0, 1, 0, 0):
        return scales["time"]
    if powers == (0, 0, 0, 1, 0):
        return scales["angle"]
    forces = -time // 2  # compound units are made of force, mass, length and rad
    others = scales["mass"] ** (mass - forces) * scales["length"] ** (length - forces)
    return float(scales["force"] ** forces * others)
