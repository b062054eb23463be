"""Codes of the messages, read from the source: every call that makes a fault states its code and its text.

A maker of faults is a class or function with a parameter `code`; what it is given there, or its default, is a code.
"""

from __future__ import annotations

import ast
import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import cache
from pathlib import Path

_CODE = re.compile(r"[a-z]+(-[a-z]+)*")
_SHOWN = re.compile(r"^error\[([a-z-]+)\]")
PACKAGE = Path(__file__).resolve().parents[1] / "pkmcal_cli"
"""The program whose messages these are."""


@dataclass(frozen=True)
class Maker:
    """A callable with a parameter `code`: the places of `code` and `message` among its arguments, the default code."""

    name: str
    place: int
    text: int | None
    default: str | None


@cache
def _trees() -> dict[Path, ast.Module]:
    return {file: ast.parse(file.read_text(encoding="utf-8")) for file in sorted(PACKAGE.rglob("*.py"))}


def _fields(node: ast.ClassDef) -> tuple[list[str], dict[str, str]]:
    """Fields of a class in order, or the parameters of its `__init__`; default codes."""
    for part in node.body:
        if isinstance(part, ast.FunctionDef) and part.name == "__init__":
            return _arguments(part)
    fields = [p for p in node.body if isinstance(p, ast.AnnAssign) and isinstance(p.target, ast.Name)]
    return [p.target.id for p in fields if isinstance(p.target, ast.Name)], {}


def _arguments(node: ast.FunctionDef) -> tuple[list[str], dict[str, str]]:
    """Names of the arguments but for self, and the default of `code` if it is a text."""
    every = [*node.args.posonlyargs, *node.args.args]
    names = [a.arg for a in every]
    defaults = dict(zip(reversed(names), reversed(node.args.defaults), strict=False))
    kept = {n: str(d.value) for n, d in defaults.items() if isinstance(d, ast.Constant) and isinstance(d.value, str)}
    names += [a.arg for a in node.args.kwonlyargs]
    return [n for n in names if n not in ("self", "cls")], kept


@cache
def makers() -> dict[str, tuple[Maker, ...]]:
    """All makers of faults, by name; methods of one name may differ."""
    found: dict[str, tuple[Maker, ...]] = {}
    for tree in _trees().values():
        for node in ast.walk(tree):
            if isinstance(node, ast.ClassDef):
                names, defaults = _fields(node)
            elif isinstance(node, ast.FunctionDef) and node.name != "__init__":
                names, defaults = _arguments(node)
            else:
                continue
            if "code" in names and ("message" in names or "hint" in names):
                text = next((names.index(n) for n in ("message", "what") if n in names), None)  # what: of a `Fault`
                maker = Maker(node.name, names.index("code"), text, defaults.get("code"))
                found[node.name] = (*found.get(node.name, ()), maker)
    return found


def _argument(call: ast.Call, name: str, place: int | None) -> ast.expr | None:
    for keyword in call.keywords:
        if keyword.arg == name:
            return keyword.value
    if place is None or place >= len(call.args) or any(isinstance(a, ast.Starred) for a in call.args[: place + 1]):
        return None
    return call.args[place]


def shown(node: ast.expr | None) -> str:
    """A text of the source with `...` for what is filled in; "" where it is computed elsewhere."""
    if isinstance(node, ast.Constant) and isinstance(node.value, str):
        return node.value
    if isinstance(node, ast.JoinedStr):
        return "".join(str(v.value) if isinstance(v, ast.Constant) else "..." for v in node.values)
    if isinstance(node, ast.BinOp):
        return shown(node.left) + shown(node.right)
    return ""


def _codes(node: ast.expr | None, constants: Mapping[str, str]) -> list[str]:
    """The codes that an expression may be; those that are only handed on are none."""
    if isinstance(node, ast.Constant) and isinstance(node.value, str):
        return [node.value] if _CODE.fullmatch(node.value) else []
    if isinstance(node, ast.Name):
        return _codes(ast.Constant(constants[node.id]), constants) if node.id in constants else []
    if isinstance(node, ast.IfExp):
        return _codes(node.body, constants) + _codes(node.orelse, constants)
    return []


@cache
def _constants() -> dict[str, str]:
    """Texts that modules name, such as `FINGERPRINT = "fingerprint"`."""
    found = {}
    for tree in _trees().values():
        for node in tree.body:
            value = node.value if isinstance(node, ast.Assign) else None
            if isinstance(value, ast.Constant) and isinstance(value.value, str):
                found |= {t.id: value.value for t in node.targets if isinstance(t, ast.Name)}  # type: ignore[union-attr]
    return found


def _text(node: ast.expr | None, function: ast.AST) -> str:
    """The text of a message: itself, or what was last assigned to its name before, in the same function."""
    if not isinstance(node, ast.Name):
        return shown(node)
    last = ""
    for each in ast.walk(function):
        if not isinstance(each, ast.Assign) or each.lineno > node.lineno:
            continue
        for target in each.targets:
            pairs = [(target, each.value)]
            if isinstance(target, ast.Tuple) and isinstance(each.value, ast.Tuple):
                pairs = list(zip(target.elts, each.value.elts, strict=True))
            for name, value in pairs:
                if isinstance(name, ast.Name) and name.id == node.id:
                    last = shown(value)
    return last


def _of_call(call: ast.Call, function: ast.AST) -> Iterator[tuple[str, str]]:
    """Codes, each with its text, that a call may give."""
    name = call.func.attr if isinstance(call.func, ast.Attribute) else getattr(call.func, "id", "")
    known = makers().get(name, ())
    for maker in known or (Maker(name, 99, None, None),):
        given = _argument(call, "code", maker.place)
        if given is None and maker.default:
            yield maker.default, _text(_argument(call, "message", maker.text), function) if len(known) == 1 else ""
        for code in _codes(given, _constants()):
            yield code, _text(_argument(call, "message", maker.text), function)


def _calls(node: ast.AST, function: ast.AST) -> Iterator[tuple[ast.Call, ast.AST]]:
    """Calls, each with the function in which it stands."""
    for child in ast.iter_child_nodes(node):
        if isinstance(child, ast.Call):
            yield child, function
        yield from _calls(child, child if isinstance(child, ast.FunctionDef) else function)


@cache
def messages() -> dict[str, tuple[str, ...]]:
    """Texts by code, `...` for what is filled in; all codes that the program can show."""
    found: dict[str, dict[str, None]] = {}
    for tree in _trees().values():
        for call, function in _calls(tree, tree):
            for code, text in _of_call(call, function):
                found.setdefault(code, {}).update({text: None} if text else {})
        for node in ast.walk(tree):
            if isinstance(node, ast.Constant) and isinstance(node.value, str):
                found |= {code: {} for code in _SHOWN.findall(node.value) if code not in found}
            elif isinstance(node, ast.Assign) and ast.unparse(node.targets[0]) == "default_code":
                found.setdefault(ast.literal_eval(node.value), {})
    return {code: tuple(sorted(texts)) for code, texts in sorted(found.items())}
