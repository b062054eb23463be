"""The catalogue of effects, for a machine or in general."""

from __future__ import annotations

from typing import Any

from pkmcal_cli.effects import PORTS, STAGES, Effect, catalogue
from pkmcal_cli.report.console import Reporter, emit_json

_SHOWN = 5


def run_effects(machine: str | None, as_json: bool, quiet: bool) -> int:
    """List the catalogue; with a machine, the places at which each effect can sit. Raises PkmcalError."""
    to = Reporter(quiet)
    sites = None if machine is None else _places(machine)
    rows, listed = [], []
    for effect in catalogue().values():
        where = None if sites is None else sites[effect.keyword]
        if where == []:
            continue
        rows.append((effect.keyword, effect.title, _short(where) or PORTS[effect.port], ", ".join(effect.needs)))
        listed.append(_json(effect, where))
    to.table(
        "Effects",
        ("keyword", "effect", "at" if machine else "enters", "needs"),
        rows,
        left=4,
        folded=("effect", "at", "enters"),
    )
    to.say("diagnose also tests every single row (bad rows) and noise that grows with distance (noise_model)")
    to.say("parameters, plausible ranges, causes and remedies: --json, docs/effects.md")
    if as_json:
        emit_json({"effects": listed})
    return 0


def _places(machine: str) -> dict[str, list[str]]:
    from pkmcal_cli.loading.machine import load_machine
    from pkmcal_cli.model.effect_sites import places

    model = load_machine(machine, receptive=True).model
    return {e.keyword: list(places(model.sockets, e, ("SESSION",))) for e in catalogue().values()}


def _short(where: list[str] | None) -> str:
    """The first few places."""
    shown = list(where or ())[:_SHOWN]
    return ", ".join(shown) + (" ..." if where is not None and len(where) > _SHOWN else "")


def _json(effect: Effect, where: list[str] | None) -> dict[str, Any]:
    return {
        "effect": effect.keyword,
        "title": effect.title,
        "symbol": effect.symbol or None,
        "source": effect.source,
        "stage": STAGES[effect.port],
        "enters": PORTS[effect.port],
        "parameters": [
            {
                "name": p.name,
                "range": p.range,
                "unit": p.unit,
                "rotary_range": p.range_in(True) if p.rotary is not None else None,
                "rotary_unit": p.rotary,
                "text": p.text,
            }
            for p in effect.parameters
        ],
        "needs": list(effect.needs),
        "at": where,
        "measurement": effect.measurement,
        "cause": effect.cause,
        "result": effect.result,
        "action": effect.action,
    }
