"""A cross slide that is squint, whose base lies within a millimetre: a machine file of closed forms."""

from __future__ import annotations

_TEXT = """
units: {length: mm, angle: deg}
space: planar
ranges: {length: 1, angle: 0.1, scale: 1 mm/m}
parameters: {x0: 0, y0: 0, turn: 0, lead: {nominal: 1}, sq: {nominal: 0, unit: deg}}
frames: {base: {at: [x0, y0], turn: turn}, head: {body: cross, turn: sq}}
guides: {long: {frame: base, along: x}, short: {frame: head, along: y}}
bodies: {cross: {guide: long, at: 0}, ram: {guide: short, at: 0, points: {tip: [0, 0]}}}
actuators: {X: {moves: cross, scale: lead}, Y: {moves: ram}}
sensors:
  tracker: {at: tip, reads: [x, y], sigma: 5 um, frame: FRAME}
"""


def cross_slide(frame: str) -> str:
    """Its file, with a tracker of the tip in a frame; further sensors may follow."""
    return _TEXT.replace("FRAME", frame)
