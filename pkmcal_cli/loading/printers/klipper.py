"""printer.cfg of Klipper: sections, options, and the block that SAVE_CONFIG writes.

An option of the file counts before the same one of that block; of several, the last one. Form:
https://github.com/Klipper3d/klipper/blob/master/klippy/configfile.py; options:
https://www.klipper3d.org/Config_Reference.html.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence

from pkmcal_cli.base.errors import Location
from pkmcal_cli.loading.printers.constants import ConstantReader, Printer, Stated

_SECTION = re.compile(r"\[\s*([^\]]+?)\s*\]")
_OPTION = re.compile(r"([A-Za-z0-9_]+)\s*[:=]\s*(.*?)\s*")
_SAVED = "#*#"
_ANGLES = {"a": "210", "b": "330", "c": "90"}
_MOST = 26

Options = dict[tuple[str, str], Stated]


def is_klipper(lines: Sequence[str]) -> bool:
    """Whether it is a file of Klipper: it has sections."""
    return any(_SECTION.fullmatch(_bare(line)) for line in lines)


def read_klipper(file: str, lines: Sequence[str], inputs: Mapping[str, str]) -> Printer:
    """The constants of a delta or a winch. Raises BadInput with all faults."""
    reader, options = ConstantReader(file, lines), _options(file, lines)
    includes = [line.strip() for line in lines if line.strip().startswith("[include ")]
    kinematics = options.get(("printer", "kinematics"))
    if kinematics is None:
        hint = f"merge what it includes: {', '.join(includes[:3])}" if includes else "give a printer.cfg"
        reader.fault("no `kinematics` in section [printer]", Location(file, 1), hint, "missing")
        reader.faults.raise_if_any()
    assert kinematics is not None
    if kinematics.text not in ("delta", "winch"):
        hint = "`delta` and `winch` can be read; write other machines by hand (docs/machine-language.md)"
        reader.fault(f"kinematics `{kinematics.text}` cannot be read", kinematics.where, hint, "kinematics")
        reader.faults.raise_if_any()
    find = _Finder(reader, options, kinematics.where)
    constants = _delta(find) if kinematics.text == "delta" else _winch(find)
    reader.faults.raise_if_any()
    notes = tuple(f"not read: {text}" for text in includes)
    return Printer(
        kinematics=kinematics.text, constants=constants, firmware="Klipper", inputs=dict(inputs), notes=notes
    )


def _bare(line: str) -> str:
    return re.split(r"[#;]", line, maxsplit=1)[0].strip()


def _options(file: str, lines: Sequence[str]) -> Options:
    """Options by section and name, in small letters."""
    own, saved = Options(), Options()
    sections = {id(own): "", id(saved): ""}
    for number, line in enumerate(lines, 1):
        block = line.startswith(_SAVED)
        into = saved if block else own
        text = _bare(line.removeprefix(_SAVED)) if block else _bare(line)
        if head := _SECTION.fullmatch(text):
            sections[id(into)] = head[1].lower()
        elif not line[:1].isspace() and (option := _OPTION.fullmatch(text)):
            place = Location(file, number, line.index(option[1]) + 1)
            into[sections[id(into)], option[1].lower()] = Stated(option[2], place)
    return saved | own


class _Finder:
    """Options that have to be there."""

    def __init__(self, reader: ConstantReader, options: Options, begin: Location) -> None:
        self.reader, self.options, self.begin = reader, options, begin

    def get(self, section: str, option: str, otherwise: Stated | None = None, positive: bool = False) -> Stated:
        """An option that is a number; a fault where it is none, or missing without a default."""
        found = self.options.get((section, option), otherwise)
        if found is None:
            hint = "SAVE_CONFIG, or a file that is included, may hold it: merge the files"
            self.reader.fault(f"no `{option}` in section [{section}]", self.begin, hint, "missing")
            return Stated("0", self.begin)
        return found if self.reader.number(found, option, positive) else Stated("0", found.where)

    def has(self, section: str) -> bool:
        """Whether a section has options."""
        return any(of == section for of, _ in self.options)


def _delta(find: _Finder) -> dict[str, Stated]:
    out = {"delta_radius": find.get("printer", "delta_radius", positive=True)}
    first: dict[str, Stated] = {}
    for tower, angle in _ANGLES.items():
        section = f"stepper_{tower}"
        for option, name in (("position_endstop", "endstop"), ("arm_length", "arm")):
            found = find.get(section, option, first.get(option), positive=option == "arm_length")
            first.setdefault(option, found)
            out[f"{name}_{tower}"] = found
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
