"""YAML with places: a tree of values that know file, line and column.

Own reading on PyYAML's events: YAML 1.2 core schema (1e-6 is a number, `no` and 12:30 are text,
012 is 12), duplicate keys are faults at both places, depth, aliases and size are bounded, only
core tags are read.
"""

from __future__ import annotations

import hashlib
import math
import re
import sys
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import yaml

from pkmcal_cli.base.errors import BadInput, FaultList, Location
from pkmcal_cli.base.files import AtHand, input_name, is_stream
from pkmcal_cli.base.shipped import missing_hint
from pkmcal_cli.yaml_source.tree import Scalar, SourceNode, size_of

MAX_BYTES = 8 * 1024 * 1024
MAX_DEPTH = 64
MAX_NODES = 200_000
MAX_ALIASES = 1000
_TOO_DEEP = f"more than {MAX_DEPTH} levels of nesting"

_LOADER: Any = getattr(yaml, "CSafeLoader", yaml.SafeLoader)
_PREFIX = "tag:yaml.org,2002:"
_CORE_TAGS = {"str", "int", "float", "bool", "null", "map", "seq"}
_INT = re.compile(r"[-+]?[0-9]+")
_BASED = re.compile(r"0o[0-7]+|0x[0-9a-fA-F]+")
_FLOAT = re.compile(r"[-+]?(\.[0-9]+|[0-9]+(\.[0-9]*)?)([eE][-+]?[0-9]+)?")
_SPECIAL = re.compile(r"[-+]?\.(inf|Inf|INF)|\.(nan|NaN|NAN)")
_FINITE = "give a finite number"
_LARGE = "check that this is the right file: no machine file needs this much"
_WORDS: dict[str, bool | None] = {
    "": None, "~": None, "null": None, "Null": None, "NULL": None, "true": True, "True": True,
    "TRUE": True, "false": False, "False": False, "FALSE": False,
}  # fmt: skip


@dataclass
class Source:
    """One file read: its tree, its lines, its sha256, and the faults found (duplicate keys)."""

    file: str
    root: SourceNode
    lines: list[str]
    sha256: str
    faults: FaultList


def read_source(file: str, kind: str = "a machine file", start: str = "space: planar") -> Source:
    """Read a YAML file (`-`: stdin) whose root is a map; `kind` and `start` are for the messages.

    Raises `BadInput` when it cannot be read, is no YAML, or breaks the limits.
    """
    data = _read_bytes(file)
    file = input_name(file)
    text = _decode(file, data)
    lines = text.splitlines()
    builder = _Builder(file, lines, kind, start)
    root = builder.build(text)
    return Source(file, root, lines, hashlib.sha256(data).hexdigest(), builder.faults)


def _read_bytes(file: str) -> bytes:
    try:
        if isinstance(file, AtHand):
            data = file.content
        elif is_stream(file):
            data = sys.stdin.buffer.read(MAX_BYTES + 1)
        else:
            with open(file, "rb") as stream:
                data = stream.read(MAX_BYTES + 1)
    except OSError as error:
        reason = error.strerror or str(error)
        hint = missing_hint(file) if isinstance(error, FileNotFoundError) else None
        hint = "give a file in this folder" if isinstance(error, IsADirectoryError) else hint
        raise _refused(file, "file", f"the file cannot be read: {reason}", hint) from None
    except ValueError as error:
        raise _refused(file, "file", f"the file cannot be read: {error}") from None
    if len(data) > MAX_BYTES:
        raise _refused(file, "file", "the file is larger than 8 MiB, the maximum")
    return data


def _decode(file: str, data: bytes) -> str:
    try:
        return data.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        line = data.count(b"\n", 0, error.start) + 1
        column = len(data[data.rfind(b"\n", 0, error.start) + 1 : error.start].decode()) + 1
        message = f"byte 0x{data[error.start]:02x} is not UTF-8"
        where = Location(file, line, column)
        raise BadInput.single(message, where, "save the file as UTF-8", "encoding") from None


def _refused(file: str, code: str, message: str, hint: str | None = None) -> BadInput:
    return BadInput.single(message, Location(file, 0), hint, code)


class _Builder:
    """Builds the tree from events, without recursion."""

    def __init__(self, file: str, lines: list[str], kind: str, start: str) -> None:
        self.file = file
        self.kind, self.start = kind, start
        self.lines = lines
        self.faults = FaultList()
        self.anchors: dict[str, SourceNode] = {}
        self.open_anchors: set[str] = set()
        self.count = 0
        self.aliases = 0

    def location(self, mark: Any) -> Location:
        return Location(self.file, mark.line + 1, mark.column + 1)

    def fault(self, code: str, message: str, where: Location, hint: str | None = None) -> BadInput:
        line = self.lines[where.line - 1] if 0 < where.line <= len(self.lines) else ""
        return BadInput.single(message, where, hint, code, line)

    def events(self, text: str) -> Iterator[Any]:
        try:
            yield from yaml.parse(text, Loader=_LOADER)
        except yaml.MarkedYAMLError as error:
            mark = error.problem_mark or error.context_mark
            where = self.location(mark) if mark else Location(self.file, 0)
            if "nesting depth" in (error.problem or ""):  # newer parsers look ahead, and have a limit of their own
                raise self.fault("yaml", _TOO_DEEP, where, _LARGE) from None
            message = f"not valid YAML: {error.problem or error.context}"
            if error.context and error.context_mark:
                message += f" ({error.context}, started in line {error.context_mark.line + 1})"
            raise self.fault("yaml", message, where, _yaml_hint(self.lines, where, error.problem or "")) from None
        except yaml.reader.ReaderError as error:
            head = text[: error.position]
            where = Location(self.file, head.count("\n") + 1, len(head) - head.rfind("\n"))
            message = f"character #x{error.character:04x} is not allowed in YAML"
            raise self.fault("yaml", message, where, "delete it") from None

    def build(self, text: str) -> SourceNode:
        root: SourceNode | None = None
        stack: list[_Open] = []
        documents = 0
        for event in self.events(text):
            if isinstance(event, yaml.NodeEvent):
                node, opened = self.node(event, len(stack))
                if stack:
                    stack[-1].put(node, self)
                else:
                    root = node
                if opened is not None:
                    stack.append(opened)
            elif isinstance(event, yaml.CollectionEndEvent):
                done = stack.pop()
                self.open_anchors.discard(done.anchor)
            elif isinstance(event, yaml.DocumentStartEvent):
                documents += 1
                if documents > 1:
                    where = self.location(event.start_mark)
                    raise self.fault("yaml", "a second document begins here", where, "keep only one document")
        return self.checked_root(root)

    def checked_root(self, root: SourceNode | None) -> SourceNode:
        if root is None or root.value is None:
            raise _refused(self.file, "yaml", "the file is empty", f"start with `{self.start}`")
        if not isinstance(root.value, dict):
            table = self.file.lower().endswith((".csv", ".tsv"))
            hint = "name the machine file first, then tables" if table else f"start with, for example, `{self.start}`"
            raise self.fault("yaml", f"{self.kind} must be a map (`key: value`)", root.where, hint)
        return root

    def node(self, event: Any, depth: int) -> tuple[SourceNode, _Open | None]:
        where = self.location(event.start_mark)
        if isinstance(event, yaml.AliasEvent):
            return self.alias(event.anchor or "", where), None
        self.add(1, where)
        self.check_tag(event, where)
        opened: _Open | None = None
        if isinstance(event, yaml.ScalarEvent):
            node = self.scalar(event, where)
        else:
            if depth >= MAX_DEPTH:
                raise self.fault("yaml", _TOO_DEEP, where, _LARGE)
            node = SourceNode({} if isinstance(event, yaml.MappingStartEvent) else [], where)
            opened = _Open(node, event.anchor or "")
            self.open_anchors.add(event.anchor or "")
        if event.anchor:
            self.anchors[event.anchor] = node
        return node, opened

    def add(self, size: int, where: Location) -> None:
        self.count += size
        if self.count > MAX_NODES:
            raise self.fault("yaml", f"more than {MAX_NODES} values in the file", where, _LARGE)

    def alias(self, anchor: str, where: Location) -> SourceNode:
        node = self.anchors.get(anchor)
        self.aliases += 1
        if node is None or anchor in self.open_anchors:
            message = f"alias `*{anchor}` is inside its own anchor" if node else f"alias `*{anchor}` has no anchor"
            raise self.fault("yaml", message, where, "write the value itself")
        if self.aliases > MAX_ALIASES:
            raise self.fault("yaml", f"more than {MAX_ALIASES} aliases in the file", where, _LARGE)
        size = size_of(node)
        self.add(size, where)
        return SourceNode(node.value, where, None, node.text, node.quoted, size)

    def check_tag(self, event: Any, where: Location) -> None:
        tag = event.tag
        if tag is None or tag == "!":
            return
        if not tag.startswith(_PREFIX) or tag[len(_PREFIX) :] not in _CORE_TAGS:
            shown = tag.replace(_PREFIX, "!!")
            raise self.fault("yaml", f"tag `{shown}` is not supported", where, "remove the tag")

    def scalar(self, event: Any, where: Location) -> SourceNode:
        text: str = event.value
        quoted = event.style not in (None, "")
        tag = (event.tag or "").removeprefix(_PREFIX)
        if tag in ("str", "!") or (quoted and not tag):
            return SourceNode(text, where, None, text, quoted)
        return SourceNode(self.resolve(text, where), where, None, text, quoted)

    def resolve(self, text: str, where: Location) -> Scalar:
        """The value of a plain scalar by the YAML 1.2 core schema; no infinity, no nan."""
        if text in _WORDS:
            return _WORDS[text]
        if _INT.fullmatch(text) and len(text) < 300:
            return int(text)
        if _BASED.fullmatch(text) and len(text) < 300:
            return int(text, 0)
        if _SPECIAL.fullmatch(text) or text in ("nan", "NaN", "inf", "Infinity", "-inf"):
            self.faults.add(self.fault("value", f"`{text}` is not a finite number", where, _FINITE).faults[0])
            return 0.0
        if _FLOAT.fullmatch(text):
            number = float(text)
            if not math.isfinite(number):
                message = f"the number `{text[:20]}` is too large"
                self.faults.add(self.fault("value", message, where, _FINITE).faults[0])
                return 0.0
            return number
        return text


class _Open:
    """A list or map that is being filled; in a map keys and values alternate."""

    def __init__(self, node: SourceNode, anchor: str) -> None:
        self.node = node
        self.anchor = anchor
        self.key: SourceNode | None = None

    def put(self, child: SourceNode, builder: _Builder) -> None:
        value = self.node.value
        if isinstance(value, list):
            value.append(child)
        elif isinstance(value, dict):
            if self.key is None:
                if child.text is None:
                    message = "a key must be a plain name"
                    hint = 'quote a name in braces: "{i}"'
                    raise builder.fault("yaml", message, child.where, hint)
                self.key = child
                return
            self.put_pair(value, self.key, child, builder)
            self.key = None

    def put_pair(self, value: dict[str, SourceNode], key: SourceNode, child: SourceNode, builder: _Builder) -> None:
        name = key.text or ""
        child.key = key.where
        first = value.get(name)
        if first is None:
            value[name] = child
            return
        again, before = key.where, first.key or first.where
        for here, other in ((before, again), (again, before)):
            message = f"duplicate key `{name}` (also in line {other.line})"
            if here.line == other.line:
                message = f"duplicate key `{name}`"
            made = builder.fault("duplicate-key", message, here, "keep only one of them")
            builder.faults.add(made.faults[0])


def _yaml_hint(lines: list[str], where: Location, problem: str) -> str:
    line = lines[where.line - 1] if 0 < where.line <= len(lines) else ""
    if "\t" in line:
        return "indent with spaces, not with tabs"
    if re.search(r":\s*[%@`]", line):
        return "quote a text that begins with a special character"
    if "mapping values are not allowed" in problem:
        return "quote a text that contains a colon and a space"
    if "did not find expected ',' or" in problem or "expected ',' or" in problem:
        return "check the brackets and commas here and above"
    return "check indentation, brackets and colons here and in the line above"
