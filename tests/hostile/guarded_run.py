"""Commands under an audit hook: what an input has made the program do that no input may.

The hook stays as long as the process. What the interpreter does for its own modules is told apart by where it comes
from; what an attack says, by its mark (`MARK`), which no other text holds.
"""

from __future__ import annotations

import ast
import os
import site
import sys
from collections.abc import Iterator
from pathlib import Path
from types import CodeType
from typing import Any

MARK = "pwn3d"
_PROCESSES = ("subprocess.", "os.system", "os.exec", "os.fork", "os.posix_spawn", "os.spawn", "os.startfile", "pty.")
_NETWORK = ("socket.", "http.", "ftplib.", "smtplib.", "urllib.", "webbrowser.")
_LOADERS = ("pickle.find_class", "sys.settrace", "os.kill")
_CHANGES = {"os.rename": 2, "os.link": 2, "os.symlink": 2, "os.remove": 1, "os.rmdir": 1, "os.mkdir": 1, "os.chmod": 1,
            "os.chown": 1, "os.truncate": 1, "os.utime": 1}  # fmt: skip
_WRITES = os.O_WRONLY | os.O_RDWR | os.O_CREAT | os.O_TRUNC | os.O_APPEND


class Guard:
    """An audit hook that notes what is forbidden: `found`, in words; while `on`."""

    def __init__(self, read: tuple[Path, ...], written: tuple[Path, ...]) -> None:
        own = (sys.prefix, sys.base_prefix, sys.exec_prefix, sys.pycache_prefix)
        packages = {*own, *site.getsitepackages(), *sys.path}
        roots = {Path(p).resolve() for p in packages if p}
        self._written = tuple(map(str, (*written, Path(os.devnull))))
        fixed = ("/etc/localtime", "/usr/share/zoneinfo", "/usr/share/fonts", "/proc/self", "/proc/cpuinfo", "/sys")
        self._read = (*map(str, roots), *map(str, read), *self._written, *fixed)
        self.on, self.found = False, list[str]()
        sys.dont_write_bytecode = True
        sys.addaudithook(self._look)

    def _look(self, event: str, arguments: tuple[Any, ...]) -> None:
        if not self.on:
            return
        self.on = False
        try:
            self.found += self._faults(event, arguments)
        finally:
            self.on = True

    def _faults(self, event: str, arguments: tuple[Any, ...]) -> Iterator[str]:
        if event.startswith((*_PROCESSES, *_NETWORK, *_LOADERS)):
            yield f"{event} {arguments!r:.200}"
        elif event == "exec" and isinstance(arguments[0], CodeType) and _says(arguments[0]):
            yield f"exec of {arguments[0].co_filename}"
        elif event == "compile" and MARK in str(arguments[0]) and not _only_a_tree():
            yield f"compile of {arguments[0]!r:.200}"
        elif event in ("import", "ctypes.dlopen", "os.putenv") and MARK in repr(arguments):
            yield f"{event} {arguments!r:.200}"
        elif event == "open" and isinstance(arguments[0], str | bytes | os.PathLike):
            yield from self._opened(os.fsdecode(arguments[0]), arguments[1], int(arguments[2] or 0))
        else:
            for name in arguments[: _CHANGES.get(event, 0)]:
                if os.path.isabs(str(name)) and not _below(os.path.abspath(name), self._written):
                    yield f"{event} {name}"

    def _opened(self, name: str, mode: Any, flags: int) -> Iterator[str]:
        path = os.path.abspath(name)
        writes = bool(flags & _WRITES) or any(c in str(mode or "") for c in "wax+")
        if writes and not _below(path, self._written):
            yield f"{path!r} opened for writing"
        elif not writes and not _below(path, self._read):
            yield f"{path!r} opened for reading"


def _below(path: str, roots: tuple[str, ...]) -> bool:
    return any(path == root or path.startswith(root.rstrip("/") + "/") for root in roots)


def _only_a_tree() -> bool:
    """Whether what is compiled comes from `ast.parse`, which makes a tree and no code."""
    frame = sys._getframe()
    while frame is not None and frame.f_globals.get("__name__") == __name__:
        frame = frame.f_back  # type: ignore[assignment]
    return frame is not None and frame.f_code is ast.parse.__code__


def _says(code: CodeType) -> bool:
    """Whether a text of an attack is in a code object."""
    texts = (*code.co_names, *code.co_varnames, *(c for c in code.co_consts if not isinstance(c, CodeType)))
    return MARK in repr(texts) or any(_says(c) for c in code.co_consts if isinstance(c, CodeType))
