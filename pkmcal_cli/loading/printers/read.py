"""A file of a printer's firmware, with those that it includes: which firmware, and its constants."""

from __future__ import annotations

import glob
import os
from collections.abc import Callable
from dataclasses import dataclass, field

from pkmcal_cli.base.errors import BadInput, Location
from pkmcal_cli.base.files import identity, input_name, is_stream, open_input, sha256
from pkmcal_cli.loading.printers.constants import Line, Printer
from pkmcal_cli.loading.printers.klipper import is_klipper, klipper_include, read_klipper
from pkmcal_cli.loading.printers.reprapfirmware import is_reprapfirmware, read_reprapfirmware, reprap_include

_LARGEST = 1 << 22  # bytes
_MOST = 100  # files


def read_printer(path: str) -> Printer:
    """The constants that a printer.cfg or config.g states. Raises BadInput with all faults."""
    text, digest = _text(path)
    for known, include, read in (
        (is_klipper, klipper_include, read_klipper),
        (is_reprapfirmware, reprap_include, read_reprapfirmware),
    ):
        if known(text.splitlines()):
            gathered = _Gathered(include)
            gathered.add(path, text, digest)
            return read(gathered.lines, gathered.inputs, gathered.notes)
    hint = "give a printer.cfg of Klipper, with [printer], or a config.g of RepRapFirmware, with M665 or M669"
    message = "this is no configuration of a printer that can be read"
    raise BadInput.single(message, Location(input_name(path), 1), hint, "printer")


@dataclass
class _Gathered:
    """Lines of a file, those of files that it includes at their places; sha256 by file; what was not read."""

    include: Callable[[str], str | None]
    lines: list[Line] = field(default_factory=list)
    inputs: dict[str, str] = field(default_factory=dict)
    notes: list[str] = field(default_factory=list)
    seen: set[tuple[int, int]] = field(default_factory=set)

    def add(self, path: str, text: str, digest: str) -> None:
        """A file."""
        there, name = identity(path), input_name(path)
        if there is not None:
            self.seen.add(there)
        self.inputs[name] = digest
        for number, line in enumerate(text.splitlines(), 1):
            self.lines.append(Line(name, number, line))
            if (pattern := self.include(line)) is not None:
                self._add_all(path, pattern, line.strip())

    def _add_all(self, path: str, pattern: str, line: str) -> None:
        files = [] if is_stream(path) else sorted(glob.glob(os.path.join(os.path.dirname(path), pattern)))
        if not files or len(self.inputs) + len(files) > _MOST:
            self.notes.append(f"not read: {line}")
            return
        for name in files:
            if identity(name) not in (None, *self.seen):
                self.add(name, *_text(name))


def _text(path: str) -> tuple[str, str]:
    """The text of a file and its sha256. Raises BadInput."""
    with open_input(path) as file:
        data = file.read(_LARGEST + 1)
        if len(data) > _LARGEST:
            where = Location(input_name(path), 1)
            raise BadInput.single("the file is too large for a configuration", where, None, "printer")
        digest = sha256(file)
    try:
        return data.decode("utf-8-sig"), digest
    except UnicodeDecodeError:
        return data.decode("latin-1"), digest
