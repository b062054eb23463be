"""The machine file of a printer, from the constants of its firmware: every constant is a parameter, digit by digit."""

from __future__ import annotations

import itertools
import json
import math
from collections.abc import Callable, Mapping, Sequence

from pkmcal_cli.loading.printers.constants import Printer, Stated

Constants = Mapping[str, Stated]
_EA = 20000  # N, of a line: a guess


def machine_text(printer: Printer) -> str:
    """The machine file."""
    source = ", ".join(f"{name} (sha256 {digest[:12]})" for name, digest in printer.inputs.items())
    head = [
        "# yaml-language-server: $schema=machine.schema.json",
        f"# {_TITLES[printer.kinematics]}. Constants of {printer.firmware}, from {_line(source)}.",
    ]
    units = ["units: {length: mm, angle: deg, force: N}", "space: spatial"]
    return "\n".join([*head, *units, *_WRITERS[printer.kinematics](printer.constants), ""])


def _line(text: str) -> str:
    return "".join(c if c.isprintable() else "?" for c in text)


def _parameter(name: str, value: Stated, note: str = "", more: str = "") -> str:
    entries = [f"nominal: {value.plain}", *([more] if more else []), *([f"note: {json.dumps(note)}"] if note else [])]
    return f"  {name}: {{{', '.join(entries)}}}"


def _towers(names: Sequence[str], angle: Callable[[str], str], rod: Callable[[str], str], radius: str) -> list[str]:
    """Guides, carriages and rods of a delta; `angle`, `rod`: by tower."""
    lines = ["", "frames: # the bed is the base: plane, horizontal, at height 0", "  bed: {at: [0, 0, 0]}"]
    lines += [f"  tower_{t}: {{turn: [0, 0, {angle(t)}]}}" for t in names]
    lines += ["guides:", *(f"  rail_{t}: {{frame: tower_{t}, along: z}}" for t in names)]
    lines += ["nodes: {nozzle: [0, 0, 0]}", "bodies:"]
    for t in names:
        height = f"sqrt({rod(t)}**2 - {radius}**2)"
        lines.append(f"  carriage_{t}: {{guide: rail_{t}, at: {height}, points: {{joint_{t}: [{radius}, 0, 0]}}}}")
    return [*lines, "bars:", *(f"  arm_of_{t}: {{between: [joint_{t}, nozzle], length: {rod(t)}}}" for t in names)]


def _switches(
    drives: Mapping[str, str], stop: Callable[[str], str], rod: Callable[[str], str], radius: str
) -> list[str]:
    """Drives counted from the switch at the top of their tower; `drives`: towers by name."""
    lines = ["", "# A reading is 0 where the carriage is at its switch, and negative below.", "actuators:"]
    for name, t in drives.items():
        at_switch = f"{stop(t)} + sqrt({rod(t)}**2 - {radius}**2)"
        lines.append(f'  {name}: {{moves: carriage_{t}, zero: {at_switch}, limits: ["-({at_switch})", 0]}}')
    probe = "  probe: {kind: touch, at: nozzle, surface: bed, sigma: 0.02 mm} # state that of your probe"
    return [*lines, "sensors:", probe, "tool_point: nozzle"]


_RANGES = ["ranges: {length: 1, angle: 1}", "", "parameters:"]
_FRAME = "it defines the frame"
_HELD = "identify: false"
_ARMS = "length of the rods, which heights of the bed hardly determine"


def _klipper_delta(c: Constants) -> list[str]:
    lines = [*_RANGES, _parameter("delta_radius", c["delta_radius"])]
    for t in "abc":
        lines.append(_parameter(f"endstop_{t}", c[f"endstop_{t}"], "height of the nozzle at the bed's centre there"))
        lines.append(_parameter(f"arm_{t}", c[f"arm_{t}"], _ARMS, _HELD))
        last = t == "c"
        lines.append(_parameter(f"angle_{t}", c[f"angle_{t}"], _FRAME if last else "", _HELD if last else ""))
    lines += _towers("abc", lambda t: f"angle_{t}", lambda t: f"arm_{t}", "delta_radius")
    drives = {f"stepper_{t}": t for t in "abc"}
    return lines + _switches(drives, lambda t: f"endstop_{t}", lambda t: f"arm_{t}", "delta_radius")


def _reprap_delta(c: Constants) -> list[str]:
    lines = [*_RANGES, _parameter("radius", c["radius"], "M665 R")]
    lines.append(_parameter("height", c["height"], "M665 H; the stops are identified", _HELD))
    for t in "xyz":
        name = t.upper()
        lines.append(_parameter(f"stop_{t}", c[f"stop_{t}"], f"M666 {name}"))
        lines.append(_parameter(f"rod_{t}", c[f"rod_{t}"], f"M665 L; {_ARMS}", _HELD))
        last = t == "z"
        note = f"M665 {name}; {_FRAME}" if last else f"M665 {name}"
        lines.append(_parameter(f"corner_{t}", c[f"corner_{t}"], note, f"unit: deg, {_HELD}" if last else "unit: deg"))
    standard = {"x": "210", "y": "330", "z": "90"}
    lines += _towers("xyz", lambda t: f"{standard[t]} + corner_{t}", lambda t: f"rod_{t}", "radius")
    drives = {t.upper(): t for t in "xyz"}
    return lines + _switches(drives, lambda t: f"height + stop_{t}", lambda t: f"rod_{t}", "radius")


def _anchored(c: Constants, names: Sequence[str], name_of: Callable[[str, str], str]) -> tuple[list[str], list[str]]:
    """Parameters, and parts, of lines from anchors; `name_of`: name of the coordinate of an anchor."""
    parameters = [_parameter(name_of(n, x), c[name_of(n, x)]) for n in names for x in "xyz"]
    parameters.append(
        f"  EA: {{nominal: {_EA}, range: {_EA // 2}, unit: N, identify: false, note: of the lines; a guess}}"
    )
    parts = ["", "ground:"]
    parts += [f"  anchor_of_{n}: [{', '.join(name_of(n, x) for x in 'xyz')}]" for n in names]
    parts += ["nodes: {nozzle: [0, 0, 0]}", "ropes:"]
    return parameters, parts + [f"  line_{n}: {{between: [anchor_of_{n}, nozzle], EA: EA}}" for n in names]


_HOMED = "# A reading is 0 where the machine is homed, with its nozzle at x = y = z = 0."
_WIDE = ["ranges: {length: 50, angle: 1}", "", "parameters:"]


def _instrument() -> list[str]:
    return [
        "sensors: # state yours",
        "  tracker: {at: nozzle, reads: [x, y, z], sigma: 1 mm, frame: machine}",
        "tool_point: nozzle",
    ]


def _holding(anchors: Mapping[str, Sequence[float]]) -> tuple[str, ...]:
    """The three lines that hold the nozzle best where it is homed: those that span most, seen from there."""

    def spanned(names: Sequence[str]) -> float:
        (a, b, c), (d, e, f), (g, h, i) = (anchors[n] for n in names)
        lengths = math.prod(math.hypot(*anchors[n]) or 1.0 for n in names)
        return abs(a * (e * i - f * h) - b * (d * i - f * g) + c * (d * h - e * g)) / lengths

    return max(itertools.combinations(anchors, 3), key=spanned)


def _winch(c: Constants) -> list[str]:
    names = sorted({name.split("_")[1] for name in c})
    parameters, parts = _anchored(c, names, lambda n, x: f"anchor_{n}_{x}")
    lines = [*_WIDE, *parameters, *parts, "", _HOMED, "actuators:"]
    held = _holding({n: [c[f"anchor_{n}_{x}"].value for x in "xyz"] for n in names})
    for n in names:
        redundant = "" if n in held else ", redundant: true"
        lines.append(f"  stepper_{n}: {{winds: line_{n}, zero: home{redundant}}}")
    return lines + _instrument()


def _hangprinter(c: Constants) -> list[str]:
    names = sorted(name.removeprefix("radius_") for name in c if name.startswith("radius_"))
    parameters, parts = _anchored(c, names, lambda n, x: f"{n}{x}")
    radii = [_parameter(f"radius_{n}", c[f"radius_{n}"], "of the spool, at the origin", "range: 2") for n in names]
    lines = [*_WIDE, *parameters, *radii, *parts, "", _HOMED, "actuators:"]
    held = _holding({n: [c[f"{n}{x}"].value for x in "xyz"] for n in names})
    for n in names:
        gear = f"{c[f'motor_{n}'].plain}/{c[f'spool_{n}'].plain}"
        redundant = "" if n in held else ", redundant: true"
        lines.append(
            f"  {n}: {{winds: line_{n}, radius: radius_{n}, ratio: {gear}, folds: {c[f'folds_{n}'].plain}, "
            f"zero: home, unit: deg{redundant}}}"
        )
    return [*lines, *_instrument(), *_buildup(c, names)]


def _buildup(c: Constants, names: Sequence[str]) -> list[str]:
    """The build-up Q as the effect: a turn changes the radius by as much, b = -Q O / (2 R) per line."""
    if c["buildup"].value == 0:
        return []
    lines = [f"effects: # of the build-up factor Q {c['buildup'].plain}"]
    for n in names:
        rate = -c["buildup"].value * c[f"lines_{n}"].value / (2.0 * c[f"radius_{n}"].value)
        lines.append(f"  buildup@{n}: {{b: {1e6 * rate!r} um/m}}")
    return lines


_WRITERS: Mapping[str, Callable[[Constants], list[str]]] = {
    "delta": _klipper_delta,
    "reprap-delta": _reprap_delta,
    "winch": _winch,
    "hangprinter": _hangprinter,
}
_TITLES = {
    "delta": "Linear delta",
    "reprap-delta": "Linear delta",
    "winch": "Winch: a nozzle on lines from anchors",
    "hangprinter": "Hangprinter: a nozzle on lines that are wound on spools",
}
