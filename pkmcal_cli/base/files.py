"""Files: `-` for stdin and stdout, reading, checksums, which names are one file."""

from __future__ import annotations

import contextlib
import hashlib
import io
import os
import shutil
import stat
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path
from typing import BinaryIO

from pkmcal_cli.base.errors import BadInput, Location
from pkmcal_cli.base.shipped import missing_hint

STREAM = "-"
_STDIN = "<stdin>"
_BLOCK = 1 << 20


class AtHand(str):
    """The name of an input that is no file: its content is at hand."""

    content: bytes

    @classmethod
    def of(cls, name: str, content: str) -> AtHand:
        """A text under a name for messages."""
        made = cls(name)
        made.content = content.encode()
        return made


def is_stream(name: Path | str) -> bool:
    """Whether the name stands for stdin or stdout."""
    return str(name) == STREAM


def input_name(source: Path | str) -> str:
    """The name of an input in messages."""
    return _STDIN if is_stream(source) else str(source)


def readable(name: str) -> str:
    """A name that any file can hold: bytes that are no UTF-8 as escapes."""
    return name.encode("utf-8", "backslashreplace").decode("utf-8")


@contextlib.contextmanager
def open_input(source: Path | str) -> Iterator[BinaryIO]:
    """A file, or stdin for `-`, opened for reading bytes, and seekable: a pipe goes to a temporary file.

    Raises BadInput where it cannot be read, and where it may never end.
    """
    if isinstance(source, AtHand):
        yield io.BytesIO(source.content)
        return
    with contextlib.ExitStack() as stack:
        try:
            file: BinaryIO = sys.stdin.buffer if is_stream(source) else stack.enter_context(open(source, "rb"))
            _check_ends(source, file)
            if is_stream(source) or not file.seekable():
                spool = stack.enter_context(tempfile.TemporaryFile())
                shutil.copyfileobj(file, spool, _BLOCK)
                spool.seek(0)
                file = spool
        except (OSError, ValueError) as error:
            raise _unreadable(source, error) from error
        yield file


def _check_ends(source: Path | str, file: BinaryIO) -> None:
    """Raises BadInput for a device: most never end. Not for a terminal, nor for one that is empty."""
    try:
        status = os.fstat(file.fileno())
    except io.UnsupportedOperation:  # a program's own stdin
        return
    device = stat.S_ISCHR(status.st_mode) or stat.S_ISBLK(status.st_mode)
    if device and not file.isatty() and status.st_rdev != os.stat(os.devnull).st_rdev:
        message, hint = "this is a device, not a file", "give a file, a pipe, or `-` for stdin"
        raise BadInput.single(message, Location(input_name(source), 1), hint, "file")


def _unreadable(source: Path | str, error: OSError | ValueError) -> BadInput:
    hint = None
    if isinstance(error, FileNotFoundError):
        hint = missing_hint(str(source))
        return BadInput.single("the file does not exist", Location(str(source), 1), hint, "file")
    if isinstance(error, IsADirectoryError):
        hint = "give a file in this folder"
    message = f"the file cannot be read: {getattr(error, 'strerror', None) or error}"
    return BadInput.single(message, Location(input_name(source), 1), hint, "file")


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


def identity(name: Path | str) -> tuple[int, int] | None:
    """What tells a file from all others, however it is called: through links, spelt otherwise, as stdin.

    None of what is not there, of pipes and devices, and of what is no file.
    """
    if isinstance(name, AtHand):
        return None
    try:
        status = os.fstat(sys.stdin.fileno()) if str(name) in (STREAM, _STDIN) else os.stat(name)
    except (OSError, ValueError):
        return None
    return (status.st_dev, status.st_ino) if stat.S_ISREG(status.st_mode) else None
