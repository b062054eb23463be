"""Repetition: an entry with `each: {i: [1, 2, 3]}` stands once for every value of i.

`{i}` is replaced in the entry's name and in every text in it; several variables go together, one
from each list at a time. A text that is only "{x}" becomes the value itself (a number stays one).
In an expression a value counts as one: `{x}**2` of -3 is 9.
"""

from __future__ import annotations

import re
from dataclasses import dataclass, field

from pkmcal_cli.base.errors import BadInput, Fault, FaultList, Location, did_you_mean
from pkmcal_cli.expressions.parser import ExpressionError, parse_expression
from pkmcal_cli.yaml_source.read import MAX_NODES
from pkmcal_cli.yaml_source.tree import Pasted, SourceNode

KEY = "each"
_VARIABLE = re.compile(r"\{([^{}]*)\}")
_ONE_WORD = re.compile(r"[A-Za-z_]\w*|(\d+\.?\d*|\.\d+)([eE][+-]?\d+)?")

Environment = dict[str, SourceNode]


@dataclass
class Expansion:
    """Expands one file's tree; faults are added at their places (`lines` of the file)."""

    lines: list[str]
    faults: FaultList
    count: int = field(default=0)

    def run(self, root: SourceNode) -> SourceNode:
        """The tree with every `each` expanded."""
        return self._expanded(root, {})

    def _fault(self, message: str, where: Location, hint: str | None = None) -> None:
        line = self.lines[where.line - 1] if 0 < where.line <= len(self.lines) else None
        self.faults.add(Fault("each", message, where, hint, line))

    def _expanded(self, node: SourceNode, env: Environment) -> SourceNode:
        if env:
            self._counted(node)
        if isinstance(node.value, list):
            parts: list[SourceNode] = [self._expanded(child, env) for child in node.value]
            return SourceNode(parts, node.where, node.key)
        if isinstance(node.value, dict):
            return self._expanded_map(node, node.value, env)
        if isinstance(node.value, str) and env and "{" in node.value:
            return self._substituted(node, node.value, env)
        return node

    def _counted(self, node: SourceNode) -> None:
        self.count += 1
        if self.count > MAX_NODES:
            message = f"`each` produces more than {MAX_NODES} values"
            raise BadInput([Fault("each", message, node.where)])

    def _expanded_map(self, node: SourceNode, entries: dict[str, SourceNode], env: Environment) -> SourceNode:
        made: dict[str, SourceNode] = {}
        for name, child in entries.items():
            where = child.key or child.where
            for inner in self._environments(name, child, where, env):
                new = self._expanded(_without_each(child), inner)
                key = self._text(name, inner, where) if "{" in name and inner else name
                if key in made:
                    self._fault(f"`each` produces `{key}` twice", where, "use every variable in the name")
                    continue
                made[key] = SourceNode(new.value, new.where, where, new.text, new.quoted)
        return SourceNode(made, node.where, node.key)

    def _environments(self, name: str, child: SourceNode, where: Location, env: Environment) -> list[Environment]:
        """The variables' values of every repetition; the given ones where there is no `each`."""
        each = child.value.get(KEY) if isinstance(child.value, dict) else None
        if each is None:
            return [env]
        lists = self._lists(each, env)
        if lists is None:
            return []
        if not any(f"{{{variable}}}" in name for variable in lists):
            variable = next(iter(lists))
            hint = f'write, for example, "{name}{{{variable}}}"'
            self._fault(f"the name `{name}` contains no variable of its `each`", where, hint)
            return []
        count = len(next(iter(lists.values())))
        return [{**env, **{v: values[i] for v, values in lists.items()}} for i in range(count)]

    def _lists(self, each: SourceNode, env: Environment) -> dict[str, list[SourceNode]] | None:
        """The values of every variable, or None after a fault."""
        example = "write, for example, `each: {i: [1, 2, 3]}`"
        if not isinstance(each.value, dict) or not each.value:
            self._fault("`each` must be a map of variables to lists", each.where, example)
            return None
        lists: dict[str, list[SourceNode]] = {}
        for variable, values in each.value.items():
            if not variable.isidentifier():
                self._fault(f"`{variable}` is not a valid variable name", values.where, example)
                return None
            if not isinstance(values.value, list) or not values.value:
                self._fault(f"variable `{variable}` needs a list of values", values.where, example)
                return None
            lists[variable] = [self._expanded(item, env) for item in values.value]
            for item in lists[variable]:
                if item.text is None or item.value is None or isinstance(item.value, bool):
                    self._fault("expected a name, text or number", item.where, example)
                    return None
        first = next(iter(lists))
        for variable, items in lists.items():
            if len(items) != len(lists[first]):
                message = f"`{variable}` has {len(items)} values, but `{first}` has {len(lists[first])}"
                self._fault(
                    message, each.value[variable].where, "give all variables of one `each` the same number of values"
                )
                return None
        return lists

    def _substituted(self, node: SourceNode, text: str, env: Environment) -> SourceNode:
        whole = _VARIABLE.fullmatch(text)
        if whole is not None and whole[1] in env:
            item = env[whole[1]]
            return SourceNode(item.value, node.where, node.key, item.text)
        new = self._text(text, env, node.where)
        known = {f"{{{name}}}": _as_one(item) for name, item in env.items()}
        expression = _VARIABLE.sub(lambda match: known.get(match[0], match[0]), text)
        return SourceNode(Pasted(new, expression), node.where, node.key, new)

    def _text(self, text: str, env: Environment, where: Location) -> str:
        def value(match: re.Match[str]) -> str:
            item = env.get(match[1])
            if item is None:
                hint = did_you_mean(match[1], env, "use one of " + ", ".join(env))
                self._fault(f"`{match[0]}` is not a variable of this `each`", where, hint)
                return next(iter(env.values())).text or ""
            return item.text or ""

        return _VARIABLE.sub(value, text)


def _as_one(item: SourceNode) -> str:
    """A value as it stands in an expression: in parentheses unless it is a word, or no expression (a sign, a unit)."""
    text = item.value.expression if isinstance(item.value, Pasted) else item.text or ""
    if _ONE_WORD.fullmatch(text):
        return text
    try:
        parse_expression(text)
    except ExpressionError:
        return text
    return f"({text})"


def _without_each(node: SourceNode) -> SourceNode:
    if not isinstance(node.value, dict) or KEY not in node.value:
        return node
    other_keys = {key: child for key, child in node.value.items() if key != KEY}
    return SourceNode(other_keys, node.where, node.key)
