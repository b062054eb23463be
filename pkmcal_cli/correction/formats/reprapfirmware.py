"""config.g of RepRapFirmware: linear delta (M665, M666), Hangprinter (M669 K6, M666; 3.5 and later).

The firmware computes in 32 bit; for the Hangprinter, where that is seen, so does what is predicted of it here.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from fractions import Fraction

import numpy as np

from pkmcal_cli.base.rotation import Array
from pkmcal_cli.correction.commanded_machine import CommandedMachine
from pkmcal_cli.correction.export_case import Draft, ExportCase, Format
from pkmcal_cli.correction.firmware import FEWEST_LINES, MOST_LINES, check_without_turns
from pkmcal_cli.correction.line_drives import HOMED, LineConstants, LineMotors, line_constants, line_gains, ways
from pkmcal_cli.correction.linear_delta import DeltaConstants, check_delta, fitted_delta
from pkmcal_cli.loading.load_machine import LoadedMachine

_KEYWORD = "reprapfirmware"
_MM = 1e-3
_STANDARD_ANGLES = np.array([210.0, 330.0, 90.0])  # deg, of towers X, Y, Z
_DIGITS = 4  # of mm, deg and percent
_ANCHORS = "ABCDI"
_LEAST_BUILDUP = 2e-6  # m: with less the firmware, in 32 bit, loses more digits than a line without build-up needs
_TEETH = 1000  # of a wheel, at most


def _rounded(values: Array, unit: float = 1.0) -> Array:
    return np.asarray((np.round(np.asarray(values) / unit, _DIGITS) + 0.0) * unit)


def _mm(values: Array | float) -> str:
    return ":".join(f"{float(v) / _MM:.{_DIGITS}f}" for v in np.atleast_1d(values))


def _delta(case: ExportCase) -> Draft:
    fit = fitted_delta(case, _KEYWORD, tilted=True)
    constants, u = fit.constants, fit.u
    corrections = _rounded((constants.angles - _STANDARD_ANGLES + 180.0) % 360.0 - 180.0)
    height = float(_rounded(np.array(constants.stops.mean()), _MM))
    stops = _rounded(constants.stops - height, _MM)
    tilt = _rounded(100.0 * constants.tilt)
    made = DeltaConstants(
        radius=float(_rounded(np.array(constants.radius), _MM)), angles=_STANDARD_ANGLES + corrections,
        rods=_rounded(constants.rods, _MM), stops=height + stops, tilt=tilt / 100.0,
    )  # fmt: skip

    def texts(remarks: Sequence[str]) -> Mapping[str, str]:
        drives = ", ".join(f"{c} = {case.name(t)}" for t, c in enumerate("XYZ"))
        corners = " ".join(f"{c}{v:.{_DIGITS}f}" for c, v in zip("XYZ", corrections, strict=True))
        ends = " ".join(f"{c}{_mm(v)}" for c, v in zip("XYZ", stops, strict=True))
        lines = [
            *(f"; {line}" for line in (f"towers: {drives}; mm, deg, tilt in percent", *remarks)),
            *([] if np.isnan(u.radius) else [_delta_u(u)]),
            f"M665 L{_mm(made.rods)} R{_mm(made.radius)} H{_mm(height)} {corners}",
            f"M666 {ends} A{tilt[0]:.{_DIGITS}f} B{tilt[1]:.{_DIGITS}f}",
        ]
        return {"": "\n".join([*lines, ""])}

    return Draft(commands=fit.towers.readings(made, case.positions), values=case.values, texts=texts)


def _delta_u(u: DeltaConstants) -> str:
    """A remark on how sure the constants are."""
    stops = " ".join(f"{c}{v / _MM:.2g}" for c, v in zip("XYZ", u.stops, strict=True))
    corners = " ".join(f"{c}{v:.2g}" for c, v in zip("XYZ", u.angles, strict=True))
    tilt = " ".join(f"{c}{100 * v:.2g}" for c, v in zip("AB", u.tilt, strict=True))
    rods = ":".join(f"{v / _MM:.2g}" for v in u.rods)
    return f"; u: M665 L{rods} R{u.radius / _MM:.2g} {corners}, M666 with H {stops} {tilt}"


class _Spools:
    """Strands and gears of the spools, by the machine file; radii and build-up are constants of the firmware."""

    def __init__(self, case: ExportCase) -> None:
        nominal = case.loaded.machine.nominal_values()
        actuators = list(case.loaded.machine.actuators.values())
        self.strands = np.array([1 if a.folds is None else round(a.folds.number(nominal)) for a in actuators])
        gears = [Fraction(abs(a.ratio.number(nominal))).limit_denominator(_TEETH) for a in actuators]
        self.motor = np.array([g.numerator for g in gears])
        self.spool = np.array([g.denominator for g in gears])
        self.signs = np.sign(line_gains(case, _KEYWORD))

    @property
    def _gear(self) -> Array:
        """Turns of the motor per turn of the spool, strands included."""
        return np.asarray(self.strands * self.spool / self.motor)

    def radii(self, gains: Array) -> Array:
        """Radii (A,) that make gains (A,)."""
        return np.asarray(np.abs(gains) * self._gear)

    def readings(self, moved: Array, more: Array) -> Array:
        """Readings (n, A) of ways (n, A): radii and build-up are `more`; stable where nothing builds up."""
        radius, buildup = more[:-1], more[-1]
        square = radius**2 - self.strands * buildup * moved
        with np.errstate(invalid="ignore"):
            return np.asarray(self.signs * self._gear * 2.0 * moved / (np.sqrt(square) + radius))

    def buildup_step(self, radii: Array, length: float) -> float:
        """The build-up that changes the way of a line by itself where it is as long as the machine."""
        return float((4.0 * (radii / length) ** 2 / self.strands).mean())

    def as_computed(self, moved: Array, more: Array) -> Array:
        """The same in 32 bit and mm, in the order of the firmware."""
        f = np.float32
        radius, way = (more[:-1] / _MM).astype(f), (moved / _MM).astype(f)
        k2 = (-self.strands * f(more[-1] / _MM)).astype(f)
        k0 = (f(2.0) * self._gear.astype(f) / k2).astype(f)
        return np.asarray(self.signs * (k0 * (np.sqrt(radius * radius + way * k2) - radius)).astype(float))


def _hangprinter(case: ExportCase) -> Draft:
    count = len(case.model.actuators)
    spools = _Spools(case)
    made = _rounded_lines(_constants(case, spools))

    def texts(remarks: Sequence[str]) -> Mapping[str, str]:
        drives = ", ".join(f"{c} = {case.name(a)}" for a, c in zip(range(count), _ANCHORS, strict=False))
        anchors = " ".join(f"{c}{_mm(p)}" for c, p in zip(_ANCHORS, made.anchors, strict=False))
        whole = [":".join(str(int(v)) for v in row) for row in (spools.strands, spools.motor, spools.spool)]
        more = "" if count == len(_ANCHORS) - 1 else f" N{count}"
        lines = [
            *(f"; {line}" for line in (f"anchors: {drives}; mm", *remarks)),
            *([] if np.isnan(made.u_anchors).all() else [_lines_u(made)]),
            f"M669 K6{more} {anchors}",
            f"M666 Q{made.more[-1] / _MM:.{_DIGITS}f} R{_mm(made.more[:-1])} U{whole[0]} O{':'.join(['1'] * count)} "
            f"L{whole[1]} H{whole[2]}",
        ]
        return {"": "\n".join([*lines, ""])}

    commands = made.home + spools.as_computed(ways(made.anchors, case.positions), made.more)
    notes = (HOMED, "needs RepRapFirmware 3.5 or later; without W in M666 it compensates no flex")
    return Draft(commands=commands, values=case.values, texts=texts, notes=notes)


def _constants(case: ExportCase, spools: _Spools) -> LineConstants:
    """Anchors, radii and build-up; the least build-up that the firmware can compute with where there is less."""
    motors = LineMotors(
        readings=spools.readings,
        start=lambda gains: np.append(spools.radii(gains), 0.0),
        steps=lambda more: np.append(more[:-1] / case.model.length, spools.buildup_step(more[:-1], case.model.length)),
    )
    constants = line_constants(case, _KEYWORD, motors)
    if constants.more[-1] >= _LEAST_BUILDUP:
        return constants
    bare = replace(
        motors,
        readings=lambda moved, more: spools.readings(moved, np.append(more, _LEAST_BUILDUP)),
        start=spools.radii,
        steps=lambda more: more / case.model.length,
    )
    constants = line_constants(case, _KEYWORD, bare)
    more, u_more = np.append(constants.more, _LEAST_BUILDUP), np.append(constants.u_more, np.nan)
    return replace(constants, more=more, u_more=u_more)


def _lines_u(made: LineConstants) -> str:
    """A remark on how sure the constants are; nothing of drives without set values."""
    known = [(k, c) for k, c in enumerate(_ANCHORS[: len(made.anchors)]) if np.isfinite(made.u_anchors[k]).all()]
    anchors = " ".join(c + ":".join(f"{v / _MM:.2g}" for v in made.u_anchors[k]) for k, c in known)
    radii = ", ".join(f"{c} {made.u_more[k] / _MM:.2g}" for k, c in known)
    buildup = "" if np.isnan(made.u_more[-1]) else f"; of Q {made.u_more[-1] / _MM:.2g}"
    return f"; u: M669 {anchors}; of the radii {radii}{buildup}"


def _rounded_lines(constants: LineConstants) -> LineConstants:
    return replace(constants, anchors=_rounded(constants.anchors, _MM), more=_rounded(constants.more, _MM))


def _winds(loaded: LoadedMachine) -> bool:
    """Whether drives wind lines, as a Hangprinter does."""
    return any(a.winds is not None for a in loaded.machine.actuators.values())


def _check(machine: CommandedMachine) -> None:
    if not _winds(machine.loaded):
        check_delta(machine, _KEYWORD)
        return
    check_without_turns(machine, _KEYWORD)
    least, most = len(_ANCHORS) - 1, len(_ANCHORS)
    if not least <= machine.count <= most:
        message = f"the Hangprinter has {least} or {most} anchors, this machine {machine.count} drives"
        winch = "`--as klipper`, or " if FEWEST_LINES <= machine.count <= MOST_LINES else ""
        raise machine.refuse(_KEYWORD, message, f"use {winch}{machine.other_forms}")
    for name, about in machine.loaded.machine.actuators.items():
        if about.winds is None or about.radius is None:
            hint = "the Hangprinter winds lines on spools; give the drive a `radius`, or use `--as klipper`"
            raise machine.refuse(_KEYWORD, f"drive `{name}` has no spool of known radius", hint)


def _draft(case: ExportCase) -> Draft:
    return _hangprinter(case) if _winds(case.loaded) else _delta(case)


REPRAPFIRMWARE = Format(
    keyword=_KEYWORD,
    title="constants of RepRapFirmware's config.g",
    sources=(
        "https://docs.duet3d.com/User_manual/Reference/Gcodes",
        "https://duet3d.dozuki.com/Wiki/M669",
        "https://github.com/Duet3D/RepRapFirmware/blob/3.5-dev/src/Movement/Kinematics/LinearDeltaKinematics.cpp",
        "https://github.com/Duet3D/RepRapFirmware/blob/3.5-dev/src/Movement/Kinematics/HangprinterKinematics.cpp",
    ),
    suffix=".g",
    draft=_draft,
    check=_check,
)
