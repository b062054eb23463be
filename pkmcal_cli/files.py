"""Reading and writing files: `-` for stdin and stdout, checksums, results that are whole or absent."""

from __future__ import annotations

import contextlib
import hashlib
import os
import secrets
import shutil
import stat
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path
from typing import IO, BinaryIO, TextIO

from pkmcal_cli.errors import BadInput, Location, OutputError, did_you_mean

STREAM = "-"
_BLOCK = 1 << 20


def is_stream(name: Path | str) -> bool:
    """Whether the name stands for stdin or stdout."""
    return str(name) == STREAM


def input_name(source: Path | str) -> str:
    """The name of an input in messages."""
    return "<stdin>" if is_stream(source) else str(source)


@contextlib.contextmanager
def open_input(source: Path | str) -> Iterator[BinaryIO]:
    """A file, or stdin for `-`, opened for reading bytes, and seekable: a pipe goes to a temporary file.

    Raises BadInput where it cannot be read.
    """
    with contextlib.ExitStack() as stack:
        try:
            file: BinaryIO = sys.stdin.buffer if is_stream(source) else stack.enter_context(open(source, "rb"))
            if is_stream(source) or not file.seekable():
                spool = stack.enter_context(tempfile.TemporaryFile())
                shutil.copyfileobj(file, spool, _BLOCK)
                spool.seek(0)
                file = spool
        except (OSError, ValueError) as error:
            raise _unreadable(source, error) from error
        yield file


def _unreadable(source: Path | str, error: OSError | ValueError) -> BadInput:
    hint = None
    if isinstance(error, FileNotFoundError):
        path = Path(source)
        with contextlib.suppress(OSError):
            near = did_you_mean(path.name, (p.name for p in path.parent.iterdir()), otherwise="")
            hint = near or None
        return BadInput.single("the file does not exist", Location(str(source), 1), hint, "file")
    if isinstance(error, IsADirectoryError):
        hint = "give the files in it"
    what = f"the file cannot be read: {getattr(error, 'strerror', None) or error}"
    return BadInput.single(what, Location(input_name(source), 1), hint, "file")


def sha256(source: Path | BinaryIO) -> str:
    """Checksum, 64 hex digits, of a file or of an open one from its start (where it is left).

    Raises BadInput where the file cannot be read.
    """
    if isinstance(source, Path):
        with open_input(source) as file:
            return sha256(file)
    digest = hashlib.sha256()
    source.seek(0)
    while block := source.read(_BLOCK):
        digest.update(block)
    source.seek(0)
    return digest.hexdigest()


def check_target(target: Path | str, *, force: bool = False) -> None:
    """Find out before the work whether a result could be written. Raises OutputError."""
    try:
        if not is_stream(target):
            _check_path(Path(target), force)
    except (OSError, ValueError) as error:
        what = f"cannot be written: {getattr(error, 'strerror', None) or error}"
        raise OutputError(what, str(target)) from error


def _check_path(path: Path, force: bool) -> None:
    if _is_device(path):
        return
    if path.is_dir():
        raise OutputError("this is a folder", str(path), "give the name of a file in it", "output")
    if not path.parent.is_dir():
        hint = f"make it first: `mkdir -p {path.parent}`"
        raise OutputError("the folder does not exist", str(path.parent), hint, "output")
    if path.exists() and not force:
        raise _exists(path)
    if not os.access(path.parent, os.W_OK):
        raise OutputError("the folder cannot be written to", str(path.parent), None, "output")


@contextlib.contextmanager
def write_text(target: Path | str, *, force: bool = False) -> Iterator[TextIO]:
    r"""A UTF-8 text (lines end in "\n") that appears at `target` when the block ends well, or not at all.

    It is written to a temporary file in the same folder, flushed to the disk and moved into place; `-` writes
    to stdout as it comes. An existing file is replaced only by `force`. Raises OutputError.
    """
    path = Path(target)
    check_target(target, force=force)
    if is_stream(target):
        with _output_errors("<stdout>"):
            try:
                yield sys.stdout
                sys.stdout.flush()
            except BrokenPipeError:
                _drop_stdout()
                raise
    elif _is_device(path):
        with _output_errors(str(path)), open(path, "w", encoding="utf-8", newline="\n") as file:
            yield file
    else:
        with _output_errors(str(path)):
            yield from _write_and_move(path.resolve() if path.is_symlink() else path, force)


def _write_and_move(path: Path, force: bool) -> Iterator[TextIO]:
    temporary = path.with_name(f".{path.name[:100]}.{secrets.token_hex(6)}.part")
    descriptor = os.open(temporary, os.O_CREAT | os.O_EXCL | os.O_WRONLY, 0o666)
    try:
        with open(descriptor, "w", encoding="utf-8", newline="\n") as file:
            if path.exists():
                os.chmod(temporary, stat.S_IMODE(path.stat().st_mode))
            yield file
            _sync(file)
        _move(temporary, path, force)
    finally:
        temporary.unlink(missing_ok=True)
    _sync_folder(path.parent)


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
    return OutputError("the file exists", str(path), "`--force` replaces it", "output")


def _is_device(path: Path) -> bool:
    """A pipe or device such as /dev/null: written directly, never replaced."""
    return path.exists() and not path.is_file() and not path.is_dir()


def _drop_stdout() -> None:
    """The reader of the pipe has gone: what is left in the buffer goes nowhere, without a second error."""
    with contextlib.suppress(OSError, ValueError):
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())


def _sync(file: IO[str]) -> None:
    file.flush()
    os.fsync(file.fileno())


def _sync_folder(folder: Path) -> None:
    with contextlib.suppress(OSError):  # some file systems cannot
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
        raise OutputError(f"cannot be written: {error.strerror or error}", name, None, "output") from error
