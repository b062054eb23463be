"""A command is walked once; at each of its file operations it is forked, and the fork goes on with that one failing.

So every operation fails in every way at the cost of one run of the command, whatever it computes before it writes. The
walker waits for each fork, keeps what it has left behind, and puts the folder back as it was: same files, same places
in files that are open. Linux only (`/proc/self/fd`).
"""

from __future__ import annotations

import contextlib
import errno
import io
import os
import pickle
import resource
import sys
import tempfile
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from pkmcal_cli import app

HOWS = ("kill", "ENOSPC", "EIO", "MemoryError", "full")
"""`full`: from this operation on no file takes more than `_ROOM` bytes."""
_ROOM = 64
_TEMPORARY = ".temporary"
_PATHS = {"open": 1, "os.rename": 2, "os.link": 2, "os.remove": 1, "os.chmod": 1, "os.mkdir": 1, "os.rmdir": 1,
          "os.fsync": 1}  # fmt: skip


@dataclass(frozen=True)
class Ended:
    """How a command has ended: exit code, 137 of one that was killed; stderr; files by name; `again`: see `walked`.

    at, how: the operation that failed, and in which way.
    """

    code: int
    err: str
    files: dict[str, bytes]
    again: Ended | None = None
    at: str = ""
    how: str = ""


def contents(folder: Path) -> dict[str, bytes]:
    """All files below a folder, by name, but those that are hidden or in hidden folders."""
    found = (p for p in sorted(folder.rglob("*")) if p.is_file())
    names = {p.relative_to(folder): p for p in found}
    return {str(n): p.read_bytes() for n, p in names.items() if not any(part.startswith(".") for part in n.parts)}


def walked(
    arguments: Sequence[str], folder: Path, hows: Sequence[str], again: Sequence[str] = ()
) -> tuple[Ended, list[Ended]]:
    """The undisturbed command, and all disturbed ones; `again`: a command that is run after each disturbed one.

    Operations are those on files below `folder`, where temporary files are too.
    """
    with tempfile.TemporaryDirectory(dir=folder.parent) as aside:
        child = os.fork()
        if not child:
            walker = _Walker(folder, Path(aside), hows, again)
            walker.end(_run(arguments, walker))
        _, status = os.waitpid(child, 0)
        assert not status, f"the walk of {' '.join(arguments)} ended with {status}"
        return pickle.loads((Path(aside) / "walk").read_bytes())  # type: ignore[no-any-return]


def _run(arguments: Sequence[str], walker: _Walker | None = None) -> tuple[int, str]:
    """A command in this process: exit code, stderr."""
    err = io.StringIO()
    sys.argv = ["pkmcal", *arguments]
    with contextlib.redirect_stdout(io.StringIO()), contextlib.redirect_stderr(err):
        if walker is not None:
            walker.start()
        try:
            code = app.run(list(arguments))
        except BaseException as error:
            code, _ = 99, err.write(f"Traceback: {error!r}")
    return code, err.getvalue()


class _Walker:
    """The audit hook of the command that is walked."""

    def __init__(self, folder: Path, aside: Path, hows: Sequence[str], again: Sequence[str]) -> None:
        self._folder, self._aside, self._hows, self._again = folder, aside, hows, again
        self._busy = self._forked = False
        self._seen: list[Ended] = []

    def start(self) -> None:
        """From now on operations are looked at; a hook stays as long as the process."""
        temporary = self._folder / _TEMPORARY
        temporary.mkdir()
        tempfile.tempdir = str(temporary)  # what a fork takes away comes back
        sys.addaudithook(self._look)
        fsync = os.fsync

        def flushed(file: int) -> None:
            self._look("os.fsync", (os.readlink(f"/proc/self/fd/{file}"),))
            fsync(file)

        os.fsync = flushed  # type: ignore[assignment]

    def end(self, ended: tuple[int, str]) -> None:
        """The process ends: a fork with its exit code, the walker leaves behind what it has seen."""
        self._busy = True
        code, err = ended
        if self._forked:
            self._leave(code, err)
        seen = Ended(code, err, contents(self._folder)), self._seen
        (self._aside / "walk").write_bytes(pickle.dumps(seen))
        os._exit(0)

    def _leave(self, code: int, err: str) -> None:
        resource.setrlimit(resource.RLIMIT_FSIZE, (resource.RLIM_INFINITY, resource.RLIM_INFINITY))
        (self._aside / "err").write_text(err, encoding="utf-8", errors="replace")
        os._exit(code)

    def _look(self, event: str, arguments: tuple[Any, ...]) -> None:
        if self._busy or self._forked:
            return
        names = [str(a) for a in arguments[: _PATHS.get(event, 0)]]
        if not any(n.startswith(str(self._folder)) for n in names):
            return
        if event == "open" and _TEMPORARY in names[0] and os.path.isdir(names[0]):
            return  # `rmtree` holds to the very folder that it has looked at: a fork would take it away
        self._busy = True
        at = " ".join((event, *map(os.path.basename, names)))
        for how in self._hows:
            self._fork(at, how)
            if self._forked:
                return
        self._busy = False

    def _fork(self, at: str, how: str) -> None:
        """The command goes on in a fork, with this operation failing; the folder is as before afterwards."""
        kept = _Kept(self._folder, self._aside / "kept")
        child = os.fork()
        if not child:
            self._forked = True
            _fail(how)
            return  # `full`: a later operation fails
        code, err = self._waited(child)
        ended = Ended(code, err, contents(self._folder), at=at, how=how)
        if self._again:
            child = os.fork()
            if not child:
                self._forked = True
                self._leave(*_run(self._again))
            ended = replace(ended, again=Ended(*self._waited(child), contents(self._folder)))
        self._seen.append(ended)
        kept.put_back()

    def _waited(self, child: int) -> tuple[int, str]:
        """Exit code and stderr of a fork that has ended."""
        _, status = os.waitpid(child, 0)
        told = self._aside / "err"
        err = told.read_text(encoding="utf-8") if told.exists() else ""
        told.unlink(missing_ok=True)
        return os.waitstatus_to_exitcode(status), err


def _fail(how: str) -> None:
    """In a fork: the operation fails, or from now on files take little."""
    if how == "kill":
        os._exit(137)
    if how == "MemoryError":
        raise MemoryError
    if how != "full":
        number = getattr(errno, how)
        raise OSError(number, os.strerror(number))
    resource.setrlimit(resource.RLIMIT_FSIZE, (_ROOM, resource.RLIM_INFINITY))


class _Kept:
    """A folder as it is: second names of its files, what they hold, and how far open ones are written."""

    def __init__(self, folder: Path, aside: Path) -> None:
        self._folder, self._aside = folder, aside
        self._folders = {p for p in folder.rglob("*") if p.is_dir()}
        self._files = [(p, p.read_bytes(), p.stat().st_mode) for p in folder.rglob("*") if p.is_file()]
        aside.mkdir()
        for number, (path, *_) in enumerate(self._files):
            os.link(path, aside / str(number))
        self._places = {}
        for file in map(int, os.listdir("/proc/self/fd")):
            with contextlib.suppress(OSError):
                if os.readlink(f"/proc/self/fd/{file}").startswith(str(folder)):
                    self._places[file] = os.lseek(file, 0, os.SEEK_CUR)

    def put_back(self) -> None:
        """The folder is as it was; what was put aside is gone."""
        there = sorted(self._folder.rglob("*"), reverse=True)
        for path in there:
            if not path.is_dir():
                path.unlink()
            elif path not in self._folders:
                path.rmdir()
        for path in sorted(self._folders):
            path.mkdir(exist_ok=True)
        for number, (path, content, mode) in enumerate(self._files):
            os.rename(self._aside / str(number), path)
            os.chmod(path, mode | 0o200)
            with open(path, "r+b") as file:
                file.write(content)
                file.truncate()
            os.chmod(path, mode)
        self._aside.rmdir()
        for file, place in self._places.items():
            os.lseek(file, place, os.SEEK_SET)
