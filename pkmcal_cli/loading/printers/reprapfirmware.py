"""config.g of RepRapFirmware: M665 and M666 of a linear delta, M669 K6 and M666 of a Hangprinter.

Of several commands the last one counts, parameter by parameter; a line may hold several: a G or M begins one. Commands:
https://docs.duet3d.com/User_manual/Reference/Gcodes; source: https://github.com/Duet3D/RepRapFirmware.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence

from pkmcal_cli.base.errors import Location
from pkmcal_cli.loading.printers.constants import ConstantReader, Line, Printer, Stated

_BEGIN = re.compile(r"\s*([Nn]\d+\s*)?[GMTgmt]\d")
_COMMAND = re.compile(r"[GMgm](\d+(?:\.\d+)?)((?:\{[^}]*\}|[^GMgm{])*)")
_MADE_OF = ("665", "666", "669")
_APART = re.compile(r"\"[^\"]*\"|\([^)]*\)")
_MACRO = re.compile(r"\s*[Mm]98\s+[Pp]\"(?:0:)?(?:/sys/)?([^\"]+)\".*")
_WORD = re.compile(r"([A-Za-z])\s*(\{[^}]*\}|[^\sA-Za-z{]+(?:[eE][+-]?\d+)?)?")
_BLOCK = re.compile(r"\s*(if|elif|else|while)\b")
_ANCHORS = "ABCDI"
_OF_DELTA = "LRHBXYZ"  # what M665 knows
_DELTA, _HANGPRINTER = "3", "6"

Words = dict[tuple[str, str], Stated]


def is_reprapfirmware(lines: Sequence[str]) -> bool:
    """Whether it is a file of RepRapFirmware that states kinematics."""
    return any(_commands(line) for line in lines)


def reprap_include(line: str) -> str | None:
    """The file that a line reads: M501 what M500 has saved, with the latest calibration; M98 a macro, whose name is
    one in the folder `/sys` of the file. None for other lines."""
    if macro := _MACRO.fullmatch(line):
        return f"..{macro[1]}" if macro[1].startswith("/") else macro[1]
    return "config-override.g" if _bare(line).split()[:1] == ["M501"] else None


def read_reprapfirmware(lines: Sequence[Line], inputs: Mapping[str, str], notes: Sequence[str]) -> Printer:
    """The constants of a linear delta or a Hangprinter. Raises BadInput with all faults."""
    reader = ConstantReader(lines)
    words = _words(lines, reader)
    kind = words.get(("669", "K"))
    delta = ("665", "L") in words or ("665", "R") in words
    if kind is None and not delta:
        hint = "a delta is set by M665, a Hangprinter by M669 K6"
        reader.fault("neither M665 nor M669 K6", lines[0].at(0), hint, "missing")
        reader.faults.raise_if_any()
    number = _DELTA if kind is None else kind.text
    if number not in (_DELTA, _HANGPRINTER):
        assert kind is not None
        hint = "K3 (linear delta) and K6 (Hangprinter) can be read; write other machines by hand (docs/my-machine.md)"
        reader.fault(f"kinematics M669 K{number} cannot be read", kind.where, hint, "kinematics")
        reader.faults.raise_if_any()
    find = _Finder(reader, words, min((s.where for s in words.values()), key=lambda w: w.line))
    constants = _delta(find) if number == _DELTA else _hangprinter(find)
    reader.faults.raise_if_any()
    kinematics = "reprap-delta" if number == _DELTA else "hangprinter"
    return Printer(
        kinematics=kinematics,
        constants=constants,
        firmware="RepRapFirmware",
        inputs=dict(inputs),
        notes=(*notes, *_flex_notes(words)),
    )


def _bare(line: str) -> str:
    """A line without texts in quotes and remarks, every character at its place."""
    return _APART.sub(lambda match: " " * len(match[0]), line).split(";", 1)[0].rstrip()


def _commands(line: str) -> list[re.Match[str]]:
    """Commands of a line that state kinematics."""
    text = _bare(line)
    every = _COMMAND.finditer(text) if _BEGIN.match(text) else ()
    return [command for command in every if command[1] in _MADE_OF]


def _words(lines: Sequence[Line], reader: ConstantReader) -> Words:
    """Parameters by command and letter; faults for commands of which nobody knows whether they are carried out."""
    out = Words()
    blocks: dict[str, int] = {}  # by file, the indent of the condition above
    for line in lines:
        indent = len(line.text) - len(line.text.lstrip())
        if _bare(line.text) and indent <= blocks.get(line.file, -1):
            del blocks[line.file]
        if _BLOCK.match(line.text):
            blocks.setdefault(line.file, indent)
        for command in _commands(line.text):
            if line.file in blocks:
                hint = "write the values that hold, without conditions, into a copy of the file"
                reader.fault(f"M{command[1]} stands in a condition", line.at(command.start() + 1), hint)
            letters = set[str]()
            for word in _WORD.finditer(command[2]):
                location, letter = line.at(command.start(2) + word.start() + 1), word[1].upper()
                if letter in letters:
                    hint = "delete one of them; the firmware takes the first"
                    reader.fault(f"M{command[1]} has {letter} twice", location, hint)
                letters.add(letter)
                out[command[1], letter] = Stated(word[2] or "", location)
    return out


def _flex_notes(words: Words) -> list[str]:
    """What to say of a Hangprinter that compensates flex: F says so in later versions, before it the weight W."""
    letter = "F" if ("666", "F") in words else "W"
    stated = words.get(("666", letter))
    if stated is None or not stated.text.strip("0."):
        return []
    return [f"M666 {letter}{stated.text}: the machine file has no compensation of flex; its constants hold without"]


class _Finder:
    """Parameters that have to be there."""

    def __init__(self, reader: ConstantReader, words: Words, begin: Location) -> None:
        self.reader, self.words, self.begin = reader, words, begin

    def several(
        self, command: str, letter: str, counts: Sequence[int], positive: bool = False, whole: bool = False
    ) -> list[Stated]:
        """Numbers `a:b:c`, as many as one of `counts`; faults where they are not so, or missing."""
        stated = self.words.get((command, letter))
        zero = [Stated("0", self.begin)] * counts[0]
        if stated is None:
            self.reader.fault(f"M{command} has no {letter}", self.begin, f"add it: `M{command} {letter}...`", "missing")
            return zero
        parts = [Stated(text, stated.where) for text in stated.text.split(":")]
        if len(parts) not in counts:
            message = f"M{command} {letter} has {len(parts)} numbers, not {' or '.join(map(str, counts))}"
            self.reader.fault(message, stated.where, "separate them by colons")
            return zero
        good = [self.reader.number(part, f"M{command} {letter}", positive, whole) for part in parts]
        return parts if all(good) else zero

    def one(self, command: str, letter: str, otherwise: str | None = None, positive: bool = False) -> Stated:
        """One number; a default where there is one."""
        if otherwise is not None and (command, letter) not in self.words:
            return Stated(otherwise, self.begin)
        return self.several(command, letter, [1], positive)[0]


def _delta(find: _Finder) -> dict[str, Stated]:
    for (command, letter), stated in find.words.items():
        if command == "665" and letter not in _OF_DELTA:
            hint = "Marlin's M665? Its rods are `L a:b:c` in RepRapFirmware, its stops M666 X, Y, Z have the other sign"
            find.reader.fault(f"M665 {letter} is none of RepRapFirmware", stated.where, hint)
    rods = find.several("665", "L", [1, 3], positive=True)
    out = {"radius": find.one("665", "R", positive=True), "height": find.one("665", "H")}
    for k, tower in enumerate("xyz"):
        out[f"rod_{tower}"] = rods[k if len(rods) > 1 else 0]
        out[f"corner_{tower}"] = find.one("665", tower.upper(), "0")
        out[f"stop_{tower}"] = find.one("666", tower.upper(), "0")
    for letter in "AB":
        tilt = find.one("666", letter, "0")
        if tilt.value != 0:
            hint = f"set {letter}0, level the bed or calibrate the towers' lean, and export again"
            find.reader.fault("a tilt of the bed (M666 A, B) has no place in the machine file", tilt.where, hint)
    if not find.reader.faults:
        find.reader.rods_reach({n: s for n, s in out.items() if n.startswith("rod_")}, out["radius"])
    return out


def _hangprinter(find: _Finder) -> dict[str, Stated]:
    count = int(find.one("669", "N", "4").value)
    if not 4 <= count <= len(_ANCHORS):
        find.reader.fault(f"{count} anchors cannot be read", find.words["669", "N"].where, "4 or 5 can")
        return {}  # everything else has as many numbers
    out: dict[str, Stated] = {}
    for k in range(count):
        letter = _ANCHORS[k]
        anchor = find.several("669", letter, [3, 1] if k == 3 else [3])
        if len(anchor) == 1:  # before 3.5: only the height of D
            anchor = [Stated("0", anchor[0].where), Stated("0", anchor[0].where), anchor[0]]
        out |= {f"{letter}{axis}": value for axis, value in zip("xyz", anchor, strict=True)}
    for letter, name in (("R", "radius"), ("U", "folds"), ("L", "motor"), ("H", "spool")):
        values = find.several("666", letter, [count], positive=True, whole=letter != "R")
        out |= {f"{name}_{_ANCHORS[k]}": value for k, value in enumerate(values)}
    lines = find.several("666", "O", [count], positive=True, whole=True) if ("666", "O") in find.words else []
    out |= {f"lines_{_ANCHORS[k]}": value for k, value in enumerate(lines or [Stated("1", find.begin)] * count)}
    return out | {"buildup": find.one("666", "Q")}
