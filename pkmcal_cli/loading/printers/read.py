"""A file of a printer's firmware: which firmware, and its constants."""

from __future__ import annotations

from pkmcal_cli.base.errors import BadInput, Location
from pkmcal_cli.base.files import input_name, open_input, sha256
from pkmcal_cli.loading.printers.constants import Printer
from pkmcal_cli.loading.printers.klipper import is_klipper, read_klipper
from pkmcal_cli.loading.printers.reprapfirmware import is_reprapfirmware, read_reprapfirmware

_LARGEST = 1 << 22  # bytes


def read_printer(path: str) -> Printer:
    """The constants that a printer.cfg or config.g states. Raises BadInput with all faults."""
    name = input_name(path)
    with open_input(path) as file:
        data = file.read(_LARGEST + 1)
        digest = sha256(file)
    if len(data) > _LARGEST:
        raise BadInput.single("the file is too large for a configuration", Location(name, 1), None, "printer")
    try:
        text = data.decode("utf-8-sig")
    except UnicodeDecodeError:
        text = data.decode("latin-1")
    lines = text.splitlines()
    if is_klipper(lines):
        return read_klipper(name, lines, {name: digest})
    if is_reprapfirmware(lines):
        return read_reprapfirmware(name, lines, {name: digest})
    hint = "give a printer.cfg of Klipper, with [printer], or a config.g of RepRapFirmware, with M665 or M669"
    raise BadInput.single("this is no configuration of a printer that can be read", Location(name, 1), hint, "printer")
