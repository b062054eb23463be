"""printer.cfg of Klipper: sections, options, and the block that SAVE_CONFIG writes.

An option of the file counts before the same one of that block; of several, the last one. Form:
https://github.com/Klipper3d/klipper/blob/master/klippy/configfile.py; options:
https://www.klipper3d.org/Config_Reference.html.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

from pkmcal_cli.base.errors import Location
from pkmcal_cli.loading.printers.constants import ConstantReader, Line, Printer, Stated

_SECTION = re.compile(r"\[\s*([^\]]+?)\s*\]")
_INCLUDE = re.compile(r"\[include\s+([^\]]+?)\s*\]")
_OPTION = re.compile(r"([A-Za-z0-9_]+)\s*[:=]\s*(.*?)\s*")
_SAVED = "#*# "
_BLOCK = re.compile(r"#\*# <-+ SAVE_CONFIG -+>")
_ANGLES = {"a": "210", "b": "330", "c": "90"}
_MOST = 26

Options = dict[tuple[str, str], Stated]


def is_klipper(lines: Sequence[str]) -> bool:
    """Whether these are lines of Klipper: they have sections."""
    return any(_SECTION.fullmatch(_bare(line)) for line in lines)


def klipper_include(line: str) -> str | None:
    """The files that a line includes; None for other lines."""
    match = _INCLUDE.fullmatch(_bare(line))
    return match[1] if match else None


def read_klipper(lines: Sequence[Line], inputs: Mapping[str, str], notes: Sequence[str]) -> Printer:
    """The constants of a delta or a winch. Raises BadInput with all faults."""
    reader = ConstantReader(lines)
    options = _options(lines, reader)
    kinematics = options.get(("printer", "kinematics"))
    if kinematics is None:
        hint = "; ".join(notes[:3]) or "give a printer.cfg"
        reader.fault("no `kinematics` in section [printer]", lines[0].at(0), hint, "missing")
        reader.faults.raise_if_any()
    assert kinematics is not None
    if kinematics.text not in ("delta", "winch"):
        hint = "`delta` and `winch` can be read; write other machines by hand (docs/machine-language.md)"
        reader.fault(f"kinematics `{kinematics.text}` cannot be read", kinematics.where, hint, "kinematics")
        reader.faults.raise_if_any()
    find = _Finder(reader, options, kinematics.where)
    constants = _delta(find) if kinematics.text == "delta" else _winch(find)
    reader.faults.raise_if_any()
    return Printer(
        kinematics=kinematics.text, constants=constants, firmware="Klipper", inputs=dict(inputs), notes=tuple(notes)
    )


def _bare(line: str) -> str:
    """A line without its remark: behind a `#` anywhere, behind a `;` at the beginning or after a blank."""
    return re.split(r"#|(?<!\S);", line, maxsplit=1)[0].strip()


def _options(lines: Sequence[Line], reader: ConstantReader) -> Options:
    """Options by section and name, in small letters; a fault where Klipper would ignore the block of SAVE_CONFIG."""
    begins = (k for k, each in enumerate(lines) if each.file == lines[0].file and _BLOCK.match(each.text))
    begin = next(begins, len(lines))
    written, saved = _Sections(), _Sections()
    for line in lines[:begin]:
        written.take(line, line.text)
    end = max((k + 1 for k, each in enumerate(lines) if each.text.strip()), default=0)
    for line in lines[begin:end]:
        if not re.match(r"#\*#( |$)", line.text):
            hint = "move it above the block; blank lines have no place there either"
            reader.fault("a line in the block of SAVE_CONFIG, which Klipper therefore ignores", line.at(1), hint)
        saved.take(line, line.text[len(_SAVED) :])
    return saved.options | written.options


@dataclass
class _Sections:
    """Takes lines as Python's configparser does: what stands further in than an option goes on with its value."""

    options: Options = field(default_factory=dict)
    section: str = ""
    indent: int | None = None  # of an option that may go on

    def take(self, line: Line, text: str) -> None:
        """A line; `text`: without the mark of the block."""
        bare, indent = _bare(text), len(text) - len(text.lstrip())
        if not bare or (self.indent is not None and indent > self.indent):
            return
        if head := _SECTION.match(bare):
            self.section, self.indent = head[1].lower(), None
            return
        self.indent = indent
        if option := _OPTION.fullmatch(bare):
            location = line.at(line.text.index(option[1]) + 1)
            self.options[self.section, option[1].lower()] = Stated(option[2], location)


class _Finder:
    """Options that have to be there."""

    def __init__(self, reader: ConstantReader, options: Options, begin: Location) -> None:
        self.reader, self.options, self.begin = reader, options, begin

    def get(self, section: str, option: str, otherwise: Stated | None = None, positive: bool = False) -> Stated:
        """An option that is a number; a fault where it is none, or missing without a default."""
        stated = self.options.get((section, option), otherwise)
        if stated is None:
            hint = "SAVE_CONFIG, or a file that is included, may hold it: merge the files"
            self.reader.fault(f"no `{option}` in section [{section}]", self.begin, hint, "missing")
            return Stated("0", self.begin)
        return stated if self.reader.number(stated, option, positive) else Stated("0", stated.where)

    def has(self, section: str) -> bool:
        """Whether a section has options."""
        return any(of == section for of, _ in self.options)


def _delta(find: _Finder) -> dict[str, Stated]:
    out = {"delta_radius": find.get("printer", "delta_radius", positive=True)}
    first: dict[str, Stated] = {}
    for tower, angle in _ANGLES.items():
        section = f"stepper_{tower}"
        for option, name in (("position_endstop", "endstop"), ("arm_length", "arm")):
            stated = find.get(section, option, first.get(option), positive=option == "arm_length")
            first.setdefault(option, stated)
            out[f"{name}_{tower}"] = stated
        out[f"angle_{tower}"] = find.get(section, "angle", Stated(angle, find.begin))
    if not find.reader.faults:
        find.reader.rods_reach({n: s for n, s in out.items() if n.startswith("arm_")}, out["delta_radius"])
    return out


def _winch(find: _Finder) -> dict[str, Stated]:
    out = {}
    for k in range(_MOST):
        letter = chr(ord("a") + k)
        if k >= 3 and not find.has(f"stepper_{letter}"):
            break
        for axis in "xyz":
            out[f"anchor_{letter}_{axis}"] = find.get(f"stepper_{letter}", f"anchor_{axis}")
    return out
