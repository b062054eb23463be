"""Writing results: whole or absent, several of them together, and never over what they are made from."""

from __future__ import annotations

import contextlib
import os
import secrets
import shutil
import stat
import sys
import tempfile
from collections.abc import Collection, Iterable, Iterator, Sequence
from pathlib import Path
from typing import IO, Any, TextIO, cast

from pkmcal_cli.base.errors import OutputError
from pkmcal_cli.base.files import identity, input_name, is_stream
from pkmcal_cli.base.visible import visible

_KEPT = 50  # characters of a name that a temporary name keeps: not longer than a file system takes


def check_target(target: Path | str | None, inputs: Collection[str], *, force: bool = False) -> None:
    """Find out before the work whether a result could be written; None: none will be.

    `inputs`: names of what it is made from, which it never replaces, not even with `force`. Raises OutputError.
    """
    if target is None or is_stream(target):
        return
    there = identity(target)
    for name in inputs:
        if there is not None and identity(name) == there:
            other = "" if name == str(target) else f", `{input_name(name)}`"
            message = f"this file is an input of the command{other}"
            raise OutputError(message, str(target), "choose another name for the result")
    with _output_errors(str(target)):
        _check_path(Path(target), force)


def _check_path(path: Path, force: bool) -> None:
    _check_name(path)
    if takes_directly(path):
        return
    if path.is_dir():
        raise OutputError("this is a folder", str(path), "give the name of a file in this folder")
    _check_folder(path.parent)
    if not path.parent.exists():
        hint = f"create it first: `mkdir -p {path.parent}`"
        raise OutputError("the folder does not exist", str(path.parent), hint)
    if path.exists() and not force:
        raise _exists(path)


def _check_name(path: Path) -> None:
    """Raises OSError or OutputError for what no file can be called."""
    try:
        with contextlib.suppress(FileNotFoundError, NotADirectoryError):
            os.lstat(path)
    except ValueError as error:
        raise OutputError(f"cannot be written: {error}", str(path)) from error


def _check_folder(folder: Path) -> None:
    """Raises OutputError where there is something else, or a folder that cannot be written to."""
    if folder.exists() and not folder.is_dir():
        raise OutputError("this is not a folder", str(folder))
    if folder.exists() and not os.access(folder, os.W_OK):
        raise OutputError("the folder is not writable", str(folder))


def check_folder(folder: str) -> None:
    """Find out before the work whether a folder is there, or can be made, and takes files: it is made, and goes again.

    What rights, file systems and names allow, only the attempt tells. Raises OutputError.
    """
    if not folder.strip():
        raise OutputError("the name of the folder is empty", hint="name a folder; this one is `.`")
    path, made = Path(folder), list[Path]()
    with _output_errors(folder):
        _check_name(path)
        _check_folder(next(p for p in (path, *path.parents) if os.path.lexists(p)))
        try:
            made.extend(_missing(path))
            for each in made:
                each.mkdir(exist_ok=True)
            os.rmdir(tempfile.mkdtemp(prefix=".", dir=path))
        finally:
            for each in reversed(made):
                with contextlib.suppress(OSError):  # another process has written there meanwhile
                    each.rmdir()


def make_folder(folder: str) -> None:
    """A folder with those that it lies in. Raises OutputError."""
    with _output_errors(folder):
        for each in _missing(Path(folder)):
            each.mkdir(exist_ok=True)


def _missing(folder: Path) -> list[Path]:
    """A folder and those that it lies in, so far as they are not there, the outermost first."""
    return [each for each in (*reversed(folder.parents), folder) if not each.is_dir()]


@contextlib.contextmanager
def write_text(target: Path | str, inputs: Collection[str], *, force: bool = False) -> Iterator[TextIO]:
    r"""A UTF-8 text (lines end in "\n") that appears at `target` when the block ends well, or not at all.

    It is written to a temporary file in the same folder, flushed to the disk and moved into place; stdout, pipes and
    devices take it as it comes. An existing file is replaced only by `force`, and never one of `inputs`, the names of
    what the text is made from. Raises OutputError.
    """
    check_target(target, inputs, force=force)
    if is_stream(target):
        with _output_errors("<stdout>"):
            try:
                yield cast(TextIO, _Shown(sys.stdout)) if sys.stdout.isatty() else sys.stdout
                sys.stdout.flush()
            except BrokenPipeError:
                _drop_stdout()
                raise
    elif takes_directly(target):
        with _output_errors(str(target)), open(target, "w", encoding="utf-8", newline="\n") as file:
            yield file
    else:
        with write_together([target], inputs, force=force) as (file,):
            yield file


class _Shown:
    """A terminal that takes a result: what has no shape is escaped."""

    def __init__(self, terminal: TextIO) -> None:
        self._terminal = terminal

    def write(self, text: str) -> int:
        """As of any file."""
        return self._terminal.write(visible(text))

    def writelines(self, lines: Iterable[str]) -> None:
        """As of any file."""
        self._terminal.writelines(map(visible, lines))

    def __getattr__(self, name: str) -> Any:
        return getattr(self._terminal, name)


@contextlib.contextmanager
def write_together(
    targets: Sequence[Path | str], inputs: Collection[str], *, force: bool = False
) -> Iterator[tuple[TextIO, ...]]:
    """Several texts as by `write_text`: all appear when the block ends well, one after the other, or none.

    All are on the disk, in temporary files (their `name`), before the first is moved, and what could be moved is
    taken back where a later one cannot. Only a process that is killed between two moves leaves the first ones
    beside what was there of the others. Raises OutputError.
    """
    for target in targets:
        check_target(target, inputs, force=force)
    paths = [Path(os.path.realpath(target) if os.path.islink(target) else target) for target in targets]
    if len({os.path.realpath(path) for path in paths}) < len(paths):
        raise OutputError("several results would be written to this file", str(targets[0]), "choose different names")
    with _output_errors(", ".join(str(target) for target in targets)), contextlib.ExitStack() as stack:
        files = tuple(stack.enter_context(_beside(path)) for path in paths)
        yield files
        for file in files:
            _sync(file)
        _move_all([(Path(file.name), path) for file, path in zip(files, paths, strict=True)], force)
        _sync_folder(paths[-1].parent)


@contextlib.contextmanager
def _beside(path: Path) -> Iterator[TextIO]:
    """A temporary file in the folder of a file, with its rights; gone at the end."""
    temporary = _name_beside(path, "part")
    try:
        with open(temporary, "x", encoding="utf-8", newline="\n") as file:
            if path.exists():
                os.chmod(temporary, stat.S_IMODE(path.stat().st_mode))
            yield file
    finally:
        _remove(temporary)


def _name_beside(path: Path, kind: str) -> Path:
    """A name that is free, in the same folder."""
    return path.with_name(f".{path.name[:_KEPT]}.{secrets.token_hex(6)}.{kind}")


def _move_all(parts: Sequence[tuple[Path, Path]], force: bool) -> None:
    """Temporary files into place, in this order; where one cannot be moved, those before it are taken back."""
    (temporary, path), *remaining = parts
    if not remaining:
        _move(temporary, path, force)
        return
    old = _name_beside(path, "old")
    try:
        if path.exists():
            _keep(path, old)
        _move(temporary, path, force)
        try:
            _sync_folder(path.parent)
            _move_all(remaining, force)
        except BaseException:
            os.replace(old, path) if old.exists() else path.unlink()
            raise
    finally:
        _remove(old)


def _remove(temporary: Path) -> None:
    """A temporary file goes; where that fails the result, which is in place or not, stays as it is."""
    with contextlib.suppress(OSError, MemoryError):
        temporary.unlink()


def _keep(path: Path, old: Path) -> None:
    """A second name of a file, or its copy."""
    try:
        os.link(path, old)
    except OSError:  # a file system without links
        shutil.copy2(path, old)


def _move(temporary: Path, path: Path, force: bool) -> None:
    """Into place; without `force` a file that has appeared meanwhile is not overwritten either."""
    if force:
        os.replace(temporary, path)
        return
    try:
        os.link(temporary, path)
    except FileExistsError as error:
        raise _exists(path) from error
    except OSError as error:  # a file system without links
        if path.exists():
            raise _exists(path) from error
        os.replace(temporary, path)


def _exists(path: Path) -> OutputError:
    return OutputError("the file already exists", str(path), "use `--force` to replace it (in Python `force=True`)")


def takes_directly(target: Path | str) -> bool:
    """Whether a result goes there as it comes: stdout, a pipe or a device such as /dev/null, which is not replaced."""
    there = os.path.exists(target) and not os.path.isfile(target) and not os.path.isdir(target)
    return is_stream(target) or there


def _drop_stdout() -> None:
    """The reader of the pipe has gone: what is left in the buffer goes nowhere, without a second error."""
    with contextlib.suppress(OSError, ValueError):
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())


def _sync(file: IO[str]) -> None:
    file.flush()
    os.fsync(file.fileno())


def _sync_folder(folder: Path) -> None:
    with contextlib.suppress(OSError, MemoryError):  # some file systems cannot, and results are in place
        descriptor = os.open(folder, os.O_RDONLY)
        try:
            os.fsync(descriptor)
        finally:
            os.close(descriptor)


@contextlib.contextmanager
def _output_errors(name: str) -> Iterator[None]:
    try:
        yield
    except OSError as error:
        raise OutputError(f"cannot be written: {error.strerror or error}", name) from error
