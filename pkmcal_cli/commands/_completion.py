"""What the shell proposes while a command is typed: names of the machine file that stands on the line.

Quick, and never an error: what cannot be read proposes nothing.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import typer

_FEW = ("auto", "all")
_SEPARATE, _STD = "separate:", "std:"


def parameters(ctx: typer.Context, args: list[str], incomplete: str) -> list[str]:
    """Parameters in a list `auto,l1,-l2`; those of declared effects where a name has an `@`."""
    names = [*_FEW, *_names(ctx, "parameters")]
    if "@" in incomplete.rpartition(",")[2]:
        from pkmcal_cli.workflow.effect_keywords import effect_parameters

        names = effect_parameters(_machine(ctx))
    return _in_list(incomplete, names)


def aims(ctx: typer.Context, args: list[str], incomplete: str) -> list[str]:
    """What points can be chosen for: parameters, `uncertainty`, effects, `separate:` and effects behind it."""
    if incomplete.startswith(_SEPARATE):
        begun = incomplete.removeprefix(_SEPARATE)
        return [_SEPARATE + name for name in _in_list(begun, _effects(ctx, begun))]
    return _in_list(incomplete, ["uncertainty", _SEPARATE, *_names(ctx, "parameters"), *_effects(ctx, incomplete)])


def effects(ctx: typer.Context, args: list[str], incomplete: str) -> list[str]:
    """Effects at the places where they can be."""
    return _in_list(incomplete, _effects(ctx, incomplete))


def limits(ctx: typer.Context, args: list[str], incomplete: str) -> list[str]:
    """Kinds of limits; `std:` with each parameter."""
    names = _names(ctx, "parameters") if incomplete.startswith(_STD) else []
    return ["heldout", "fitted", "chi2", "change", *([f"{_STD}{name}" for name in names] or [_STD])]


def coordinates(ctx: typer.Context, args: list[str], incomplete: str) -> list[str]:
    """Coordinates of a tool point."""
    return ["x", "y", "z", "rx", "ry", "rz"]


def one_of(*words: str) -> Callable[[str], Sequence[str]]:
    """Words that an option or argument can be."""

    def some(incomplete: str) -> Sequence[str]:
        return [word for word in words if word.startswith(incomplete)]

    return some


def commands(incomplete: str) -> list[str]:
    """All subcommands."""
    from pkmcal_cli.commands._group import names

    return [name for name in names() if name.startswith(incomplete)]


def drives(ctx: typer.Context, args: list[str], incomplete: str) -> list[str]:
    """Drives, each with `=`, behind which an offset stands."""
    return [f"{name}=" for name in _names(ctx, "actuators")]


def sizes(ctx: typer.Context, args: list[str], incomplete: str) -> list[str]:
    """Parameters, each with `=`, behind which a size stands."""
    return [f"{name}=" for name in _names(ctx, "parameters")]


def _in_list(incomplete: str, names: list[str]) -> list[str]:
    """Names for the last entry of a list, behind those that are there."""
    done, comma, last = incomplete.rpartition(",")
    minus = "-" if last.startswith("-") else ""
    taken = {part.removeprefix("-") for part in done.split(",")}
    return [f"{done}{comma}{minus}{name}" for name in names if name not in taken]


def _effects(ctx: typer.Context, incomplete: str) -> list[str]:
    """Effects that begin like the last entry, at each of their places; none where it is empty: all are many."""
    last = incomplete.rpartition(",")[2].removeprefix("-")
    if not last:
        return []
    from pkmcal_cli.workflow.effect_keywords import effects_like

    return effects_like(last, _machine(ctx))


def _names(ctx: typer.Context, section: str) -> list[str]:
    """Names of a section of the machine file on the line."""
    from pkmcal_cli.loading.names import names_in

    return names_in(machine, section) if (machine := _machine(ctx)) else []


def _machine(ctx: typer.Context) -> str:
    """The machine on the line, "" for none."""
    machine = ctx.params.get("machine") or next(iter(ctx.args), None)  # an option without its value spoils `params`
    return machine if isinstance(machine, str) else ""
