"""What the shell proposes while a command is typed: names of the machine file that stands on the line.

Quick, and never an error: what cannot be read proposes nothing.
"""

from __future__ import annotations

import typer

_FEW = ("auto", "all")


def parameters(ctx: typer.Context, args: list[str], incomplete: str) -> list[str]:
    """Parameters in a list `auto,l1,-l2`; drives and sensors after `@`, where effects are."""
    return _in_list(incomplete, [*_FEW, *_names(ctx, "parameters")], _places(ctx))


def aims(ctx: typer.Context, args: list[str], incomplete: str) -> list[str]:
    """What points can be chosen for: parameters, `uncertainty`, effects at drives and sensors."""
    places = _places(ctx)
    names = ["uncertainty", *_names(ctx, "parameters"), *_effects(incomplete, places)]
    return _in_list(incomplete, names, places)


def effects(ctx: typer.Context, args: list[str], incomplete: str) -> list[str]:
    """Effects at drives and sensors."""
    places = _places(ctx)
    return _in_list(incomplete, _effects(incomplete, places), places)


def drives(ctx: typer.Context, args: list[str], incomplete: str) -> list[str]:
    """Drives, each with `=`, behind which an offset stands."""
    return [f"{name}=" for name in _names(ctx, "actuators")]


def sizes(ctx: typer.Context, args: list[str], incomplete: str) -> list[str]:
    """Parameters, each with `=`, behind which a size stands."""
    return [f"{name}=" for name in _names(ctx, "parameters")]


def _in_list(incomplete: str, names: list[str], after_at: list[str]) -> list[str]:
    """Names for the last entry of a list, behind those that are there."""
    done, comma, last = incomplete.rpartition(",")
    minus = "-" if last.startswith("-") else ""
    effect, at, _ = last.removeprefix("-").partition("@")
    choices = [f"{effect}@{place}" for place in after_at] if at else names
    taken = {part.removeprefix("-") for part in done.split(",")}
    return [f"{done}{comma}{minus}{name}" for name in choices if name not in taken]


def _effects(incomplete: str, places: list[str]) -> list[str]:
    """Effects of the catalogue that begin like the last entry, at each place; none where it is empty: all are many."""
    last = incomplete.rpartition(",")[2].removeprefix("-")
    if not last or "@" in last or not places:
        return []
    from pkmcal_cli.workflow.effect_keywords import keywords_like

    return [f"{keyword}@{place}" for keyword in keywords_like(last) for place in places]


def _places(ctx: typer.Context) -> list[str]:
    return [*_names(ctx, "actuators"), *_names(ctx, "sensors")]


def _names(ctx: typer.Context, section: str) -> list[str]:
    """Names of a section of the machine file on the line."""
    machine = ctx.params.get("machine") or next(iter(ctx.args), None)  # an option without its value spoils `params`
    if not isinstance(machine, str):
        return []
    from pkmcal_cli.loading.names import names_in

    return names_in(machine, section)
