"""Machines with instruments of every kind that reads places, lengths or angles."""

from __future__ import annotations

from tests.command import MACHINES

PLANAR_INSTRUMENTS = f"""
extends: {MACHINES / "scissors.yaml"}
parameters:
  {{w0: {{nominal: 5, range: 1}}, ws: {{nominal: 1.1, range: 0.01, unit: "1"}},
   t: {{nominal: 0.3, range: 0.01, unit: rad}}}}
ground: {{ball: [100, -750], hook: [-300, -900]}}
frames: {{bed: {{at: [0, -100], turn: t}}}}
sensors:
  level: {{at: platform, reads: [rz], frame: machine, sigma: 1 urad}}
  slide: {{at: platform, reads: [y], frame: machine, sigma: 5 um}}
  ballbar: {{kind: distance, at: platform, offset: [30, -50], to: ball, sigma: 1 um}}
  wire: {{kind: distance, at: A2, to: hook, zero: w0, scale: ws, sigma: 10 um}}
  inner: {{kind: distance, at: platform, to: B1, sigma: 10 um}}
  calipers: {{kind: span, at: platform, offset: [30, -50], zero: w0, sigma: 20 um}}
  probe: {{kind: touch, at: platform, offset: [0, -50], surface: bed, scale: ws, sigma: 5 um}}
  edge: {{kind: touch, at: platform, surface: bed, reads: [x, y], sigma: 5 um}}
  encoder: {{kind: angle, at: B1, to: A1, zero: t, unit: deg, sigma: 2 urad}}
  gauge: {{kind: bench, of: l1 - l2, reading: 0.0, sigma: 1 um}}
"""
SPATIAL_INSTRUMENTS = f"""
extends: {MACHINES / "delta4.yaml"}
parameters:
  {{w0: {{nominal: 5, range: 1}}, ws: {{nominal: 1.1, range: 0.01, unit: "1"}},
   pa: {{nominal: 0.2, range: 0.01, unit: rad}}, pb: {{nominal: -0.3, range: 0.01, unit: rad}}}}
ground: {{ball: [30, -700, -900]}}
frames: {{bed: {{at: [10, 20, -560], turn: [pa, pb, 0.1]}}}}
sensors:
  level: {{at: platform, reads: [rx, ry], frame: machine, sigma: 1 urad}}
  grid: {{at: platform, reads: [x, y], frame: machine, sigma: 1 um}}
  ballbar: {{kind: distance, at: platform, offset: [5, 6, -70], to: ball, sigma: 1 um}}
  wire: {{kind: distance, at: P2a, to: ball, zero: w0, scale: ws, sigma: 10 um}}
  inner: {{kind: distance, at: platform, to: C1a, sigma: 10 um}}
  calipers: {{kind: span, at: platform, offset: [5, 6, -70], scale: ws, sigma: 20 um}}
  probe: {{kind: touch, at: platform, offset: [0, 0, -50], surface: bed, zero: w0, sigma: 5 um}}
  edge: {{kind: touch, at: platform, surface: bed, reads: [y, z], sigma: 5 um}}
  encoder: {{kind: angle, at: C2a, to: P2a, axis: y, zero: pa, unit: deg, sigma: 0.001 deg}}
  gauge: {{kind: bench, of: l1a - l1b, reading: 0.02 mm, sigma: 1 um}}
"""
