"""Guides: one thing carries each of them, and no carriage carries its own guide."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from pkmcal_cli.language.machine import WrittenMachine

_CARRIERS = ("frame", "body", "beam")


def check_guides(machine: WrittenMachine, fault: Callable[..., Any]) -> None:
    """Checks the guides and frames of a machine as written; `fault(what, path, hint, at_key=...)` takes each fault."""
    for name, guide in machine.guides.items():
        carriers = [key for key in _CARRIERS if getattr(guide, key) is not None]
        for extra in carriers[1:]:
            message = f"guide `{name}` cannot have both `{carriers[0]}` and `{extra}`"
            fault(message, ("guides", name, extra), "keep the one that carries it", at_key=True)
        for key in ("at", "along"):
            if guide.beam is not None and key in guide.model_fields_set:
                message = f"guide `{name}` is a beam: its travel is the way from the beam's first point to its second"
                fault(message, ("guides", name, key), f"delete `{key}`", at_key=True)
    _check_carriers(machine, fault)
    for name, sensor in machine.sensors.items():
        frame = machine.frames.get(sensor.surface or "")
        if frame is not None and frame.body is not None:
            message = (
                f"frame `{sensor.surface}` moves with body `{frame.body}`, but what is probed must be fixed to the base"
            )
            fault(message, ("sensors", name, "surface"), "use a frame without `body`")


def _check_carriers(machine: WrittenMachine, fault: Callable[..., Any]) -> None:
    """Carriages that stand on themselves, directly or by other guides."""
    reported: set[str] = set()
    for name, body in machine.bodies.items():
        below = _below(machine, name)
        if name not in below or reported & below:
            continue
        reported |= below
        guide = machine.guides[body.guide or ""]
        key = next(key for key in reversed(_CARRIERS) if getattr(guide, key) is not None)
        message = f"guide `{body.guide}` is carried by its own carriage `{name}`"
        fault(message, ("guides", body.guide or "", key), "let something else carry it")


def _below(machine: WrittenMachine, body: str) -> set[str]:
    """Bodies that carry the guide of a body, and the guides of these, and so on."""
    owners = {point: name for name, about in machine.bodies.items() for point in about.points}
    out: set[str] = set()
    waiting = [body]
    while waiting:
        guide = machine.guides.get(machine.bodies[waiting.pop()].guide or "")
        if guide is None:
            continue
        frame, beam = machine.frames.get(guide.frame or ""), machine.beams.get(guide.beam or "")
        ends = () if beam is None else (owners.get(end, end) for end in beam.between)
        for carrier in (guide.body, None if frame is None else frame.body, *ends):
            if carrier in machine.bodies and carrier not in out:
                out.add(carrier)
                waiting.append(carrier)
    return out
