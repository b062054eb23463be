"""Overlays: `extends: other.yaml` merges a file over another one, by name.

Maps merge deeply, `null` deletes, everything else replaces. Chains are allowed, cycles are not.
Every value keeps the place in the file that it came from.
"""

from __future__ import annotations

import os
from collections.abc import Mapping
from dataclasses import dataclass, field

from pkmcal_cli.base.errors import BadInput, Fault, FaultList, did_you_mean, nearest
from pkmcal_cli.language.each import Expansion
from pkmcal_cli.yaml_source.read import Source, read_source
from pkmcal_cli.yaml_source.tree import SourceMap, SourceNode, cut_by_comma

KEY = "extends"
MAX_CHAIN = 16
_SHORT = {"parameters": "nominal", "nodes": "at"}
"""Sections whose entries may be a bare value: the key that it stands for."""


@dataclass
class Loaded:
    """The merged tree of a machine file, and (path, sha256) of every file it came from."""

    source: SourceMap
    files: tuple[tuple[str, str], ...]


def load(file: str, faults: FaultList) -> Loaded:
    """Read a file and all that it extends, expand `each`, merge.

    Faults (duplicate keys, `each`, deletions of nothing) are added; raises `BadInput` where
    reading cannot go on (no YAML, a file that cannot be read, a cycle).
    """
    chain = _Chain(faults)
    root = chain.read(file)
    return Loaded(SourceMap(root, chain.lines), tuple(chain.files))


@dataclass
class _Chain:
    faults: FaultList
    lines: dict[str, list[str]] = field(default_factory=dict)
    files: list[tuple[str, str]] = field(default_factory=list)
    seen: list[str] = field(default_factory=list)

    def read(self, file: str) -> SourceNode:
        """The merged tree of a file and what it extends."""
        read = read_source(file)
        self.seen.append(os.path.realpath(file))
        self.lines[read.file] = read.lines
        self.files.append((read.file, read.sha256))
        for fault in read.faults:
            self.faults.add(fault)
        _refuse_parameters(read)
        over = Expansion(read.lines, self.faults).run(read.root)
        extends = over.child(KEY)
        if extends is None:
            return over
        return self.merged(self.base(extends, file, read), over, ())

    def base(self, extends: SourceNode, file: str, read: Source) -> SourceNode:
        line = read.lines[extends.where.line - 1]
        if not isinstance(extends.value, str) or not extends.value.isprintable():
            message = "`extends` must be the path of a machine file"
            raise BadInput.single(
                message, extends.where, "write, for example, `extends: machine.yaml`", "extends", line
            )
        folder = os.path.dirname(file)
        path = os.path.normpath(os.path.join(folder, extends.value))
        if os.path.realpath(path) in self.seen or len(self.seen) >= MAX_CHAIN:
            message = f"circular `extends`: `{extends.value}` extends this file"
            if os.path.realpath(path) == self.seen[-1]:
                message = "the file extends itself"
            elif os.path.realpath(path) not in self.seen:
                message = f"more than {MAX_CHAIN} files in one `extends` chain"
            remedy = "delete one `extends:` from the chain"
            raise BadInput.single(message, extends.where, remedy, "extends", line)
        if not os.path.isfile(path):
            message = f"the file `{extends.value}` does not exist"
            if os.path.exists(path):
                message = f"`{extends.value}` is not a regular file"
                raise BadInput.single(message, extends.where, "give the path of a machine file", "extends", line)
            hint = did_you_mean(extends.value, _yaml_files(folder), "give the path relative to this file")
            raise BadInput.single(message, extends.where, hint, "extends", line)
        return self.read(path)

    def merged(self, base: SourceNode, over: SourceNode, path: tuple[str, ...]) -> SourceNode:
        """`over` laid over `base`; neither is changed."""
        if len(path) == 2 and path[0] in _SHORT:
            base, over = _promoted(base, over, _SHORT[path[0]])
        if not isinstance(base.value, dict) or not isinstance(over.value, dict):
            return over
        made = dict(base.value)
        for key, child in over.value.items():
            if child.value is None:
                self.delete(made, key, over.value, path)
            elif key in made:
                new = self.merged(made[key], child, (*path, key))
                made[key] = SourceNode(new.value, new.where, child.key, new.text, new.quoted)
            else:
                made[key] = child
        return SourceNode(made, over.where, over.key)

    def delete(
        self, made: dict[str, SourceNode], key: str, over: Mapping[str, SourceNode], path: tuple[str, ...]
    ) -> None:
        if made.pop(key, None) is not None:
            return
        where = over[key].key or over[key].where
        message = f"cannot delete `{'.'.join((*path, key))}`: it does not exist"
        close = nearest(key, made)
        hint = f"did you mean `{close}`?" if close else "use `null` only to delete an entry of the extended file"
        hint = cut_by_comma(over, key) or hint
        line = self.lines[where.file][where.line - 1]
        self.faults.add(Fault("extends", message, where, hint, line))


def _refuse_parameters(read: Source) -> None:
    """Raises `BadInput` for a parameter file: each of its keys would be one that a machine does not have."""
    mark = read.root.child("fingerprint")
    if mark is None or read.root.child("space") is not None or read.root.child(KEY) is not None:
        return
    where = mark.key or mark.where
    message, remedy = "this is a parameter file, no machine", "name the machine file first, and this one by `-p`"
    raise BadInput.single(message, where, remedy, "missing-key", read.lines[where.line - 1])


def _promoted(base: SourceNode, over: SourceNode, key: str) -> tuple[SourceNode, SourceNode]:
    """Bare values as maps, so that `l1: 300` and `l1: {range: 1}` merge."""

    def promote(node: SourceNode) -> SourceNode:
        if isinstance(node.value, dict):
            return node
        inner = SourceNode(node.value, node.where, node.where, node.text, node.quoted)
        return SourceNode({key: inner}, node.where, node.key)

    if isinstance(base.value, dict) or isinstance(over.value, dict):
        return promote(base), promote(over)
    return base, over


def _yaml_files(folder: str) -> list[str]:
    try:
        entries = os.listdir(folder or ".")
    except OSError:
        return []
    return [name for name in entries if name.endswith((".yaml", ".yml"))]
