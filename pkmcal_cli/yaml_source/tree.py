"""The tree of a YAML file: values that know their place, and the map from path to place."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from pkmcal_cli.base.errors import Fault, Location

Scalar = str | int | float | bool | None
Path = tuple[str | int, ...]


class Pasted(str):
    """A text into which `each` pasted values; `expression`: the same with every value in parentheses that needs them.

    Names, units and remarks take the text, a field that holds a quantity the expression.
    """

    expression: str

    def __new__(cls, text: str, expression: str = "") -> Pasted:
        """The text as it stands in a name, and as it stands in an expression."""
        made = super().__new__(cls, text)
        made.expression = expression
        return made


@dataclass(slots=True)
class SourceNode:
    """A value of the file: a scalar, a list or a map of nodes; where it and its key stand."""

    value: Scalar | list[SourceNode] | dict[str, SourceNode]
    where: Location
    key: Location | None = None
    text: str | None = None
    quoted: bool = False
    size: int = 1

    def plain(self) -> Any:
        """The value as plain data; lists become tuples."""
        if isinstance(self.value, dict):
            return {key: node.plain() for key, node in self.value.items()}
        if isinstance(self.value, list):
            return tuple(node.plain() for node in self.value)
        return self.value

    def child(self, part: str | int) -> SourceNode | None:
        """The node under a key or an index."""
        if isinstance(self.value, dict):
            return self.value.get(str(part))
        if isinstance(self.value, list) and isinstance(part, int) and part < len(self.value):
            return self.value[part]
        return None


@dataclass
class SourceMap:
    """The place of every value by its path, and the text of the lines."""

    root: SourceNode = field(default_factory=lambda: SourceNode({}, Location("", 0)))
    lines: dict[str, list[str]] = field(default_factory=dict)

    def node(self, path: Path) -> SourceNode:
        """The deepest node on the path; parts that the file does not have are passed over."""
        node = self.root
        for part in path:
            node = node.child(part) or node
        return node

    def __getitem__(self, path: Path) -> Location:
        """Where the value stands."""
        return self.node(path).where

    def key(self, path: Path) -> Location:
        """Where the key of the value stands; the value's place in a list."""
        node = self.node(path)
        return node.key or node.where

    def line(self, where: Location) -> str | None:
        """The text of a line."""
        lines = self.lines.get(where.file, [])
        return lines[where.line - 1] if 0 < where.line <= len(lines) else None

    def fault(
        self,
        code: str,
        message: str,
        path: Path,
        hint: str | None = None,
        offset: int = 0,
        *,
        at_key: bool = False,
        warning: bool = False,
    ) -> Fault:
        """A fault at the value of a path (or at its key), `offset` characters into its text."""
        node = self.node(path)
        where = node.key if at_key and node.key is not None else node.where
        if offset and not at_key:
            where = self._inside(node, offset)
        severity: Any = "warning" if warning else "error"
        return Fault(code, message, where, hint, self.line(where), severity)

    def _inside(self, node: SourceNode, offset: int) -> Location:
        """A place inside a scalar, when its text stands in the line as it is."""
        line, text = self.line(node.where), node.text
        start = node.where.column - 1 + (1 if node.quoted else 0)
        if line is None or text is None or line[start : start + len(text)] != text:
            return node.where
        return Location(node.where.file, node.where.line, start + offset + 1)


def size_of(node: SourceNode) -> int:
    """How many values a node holds, aliases expanded."""
    total, stack = 0, [node]
    while stack:
        at = stack.pop()
        if at.size > 1:
            total += at.size
        elif isinstance(at.value, dict):
            stack.extend(at.value.values())
        elif isinstance(at.value, list):
            stack.extend(at.value)
        total += 1
    return total


def cut_by_comma(entries: Mapping[str, SourceNode], key: str) -> str | None:
    """How to write what a comma within braces has cut into an entry and `key`, which has no value; None elsewhere."""
    names, rest = list(entries), entries.get(key)
    if rest is None or rest.value is not None or rest.text or not names.index(key):
        return None
    last = names[names.index(key) - 1]
    before = entries[last].text or ""
    if key[:1].isdigit():
        return f"write the decimal mark as a point: `{before}.{key}`"
    if last == "note" or " " in key or " " in before:  # texts of several words
        return f'a comma ends a text within braces; write it in quotes: `"{before}, {key}"`'
    return None
