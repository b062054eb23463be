"""The catalogue of effects, for a machine or in general."""

from __future__ import annotations

from typing import Any

from pkmcal_cli.base.errors import UsageError
from pkmcal_cli.effects import ENTRIES, STAGES, Effect, catalogue
from pkmcal_cli.report.console import Reporter, emit_json, enveloped
from pkmcal_cli.workflow.effects_request import EffectsRequest

ANY_SESSION = "SESSION"
"""Place of an effect of sessions, which only tables name."""
_SHOWN = 5


def run_effects(request: EffectsRequest) -> int:
    """List the catalogue; with a machine, places, or what each effect does there. Raises PkmcalError."""
    machine = request.machine
    if request.simulate:
        from pkmcal_cli.workflow.simulated_effects import run_simulated_effects

        if machine is None:
            raise UsageError("--simulate needs a machine file", hint="write `pkmcal effects M.yaml --simulate`")
        return run_simulated_effects(machine, request)
    if any(option is not None for option in (request.poses, request.grid, request.parameters)):
        raise UsageError("poses and parameters are for simulation", hint="add `--simulate`")
    to = Reporter(request.quiet)
    sites, inputs = (None, {}) if machine is None else effect_places(machine)
    rows, listed = [], []
    for effect in catalogue().values():
        where = None if sites is None else sites[effect.keyword]
        if where == []:
            continue
        rows.append((effect.keyword, effect.title, _short(where) or ENTRIES[effect.enters], ", ".join(effect.needs)))
        listed.append(_json(effect, where))
    to.table(
        "Effects",
        ("keyword", "effect", "at" if machine else "acts on", "needs"),
        rows,
        folded=("effect", "at", "acts on", "needs"),
    )
    to.say("`diagnose` also tests each row (bad rows) and noise that grows with distance (noise_model)")
    to.say("parameters, plausible ranges, causes and remedies: see --json and docs/effects.md")
    if request.as_json:
        from pkmcal_cli.report.provenance import provenance

        emit_json(enveloped("effects", "complete", {"effects": listed}, provenance(inputs)))
    return 0


def effect_places(machine: str) -> tuple[dict[str, list[str]], dict[str, str]]:
    """Places of each effect by its keyword, and the files read with their sha256. Raises PkmcalError."""
    from pkmcal_cli.loading.load_machine import load_machine
    from pkmcal_cli.model.effect_sites import places

    loaded = load_machine(machine, receptive=True)
    sites = loaded.model.sites
    return {e.keyword: list(places(sites, e, (ANY_SESSION,))) for e in catalogue().values()}, loaded.inputs


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
        "stage": STAGES[effect.enters],
        "enters": ENTRIES[effect.enters],
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
