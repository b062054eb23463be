"""Effects of a machine, for those who type them: what cannot be read proposes nothing."""

from __future__ import annotations

from pkmcal_cli.effects import catalogue


def effects_like(begin: str, machine: str) -> list[str]:
    """Effects at the places that a machine has for them, `backlash@q1`, that begin with some letters."""
    keywords = [keyword for keyword in catalogue() if keyword.startswith(begin.partition("@")[0])]
    if not keywords or not machine:
        return []
    from pkmcal_cli.base.errors import PkmcalError
    from pkmcal_cli.base.shipped import machine_file
    from pkmcal_cli.workflow.effects import ANY_SESSION, effect_places

    try:
        places, _ = effect_places(machine_file(machine))
    except (PkmcalError, OSError, ValueError, RecursionError):
        return []
    every = (f"{keyword}@{at}" for keyword in keywords for at in places[keyword] if at != ANY_SESSION)
    return [name for name in every if name.startswith(begin)]


def effect_parameters(machine: str) -> list[str]:
    """Names of the parameters of effects that a machine file declares."""
    from pkmcal_cli.base.errors import PkmcalError
    from pkmcal_cli.base.shipped import machine_file
    from pkmcal_cli.loading.load_machine import load_machine

    try:
        names = load_machine(machine_file(machine)).model.names if machine else ()
    except (PkmcalError, OSError, ValueError, RecursionError):
        return []
    return [name for name in names if "@" in name]
