"""Members of a machine that may err alike: of one `each`, drives or sensors of one kind, above and below, its own."""

from __future__ import annotations

from collections.abc import Iterator, Mapping

import numpy as np

from pkmcal_cli.language.channels import kind_of_sensor
from pkmcal_cli.language.effect_numbers import LINEAR, ROTARY
from pkmcal_cli.language.machine import Machine
from pkmcal_cli.language.sections import driven_sections, sections_with
from pkmcal_cli.model.effect_sites import EffectGroups, EffectSites
from pkmcal_cli.yaml_source.tree import Path

UPPER, LOWER = "upper", "lower"
_APART = 0.5  # of the difference of all heights, that lies between those above and those below


def effect_groups(machine: Machine, sites: EffectSites) -> EffectGroups:
    """Groups of places by name, those of the machine file first; a group of the same members stands once.

    Where some drives turn and others do not, those of a group are also two groups, as numbers of one are angles and of
    the other lengths.
    """
    named: dict[str, tuple[str, ...]] = {}
    levels = (group for level in _levels(machine, sites) for group in _by_unit(machine, *level))
    declared = (group for one in machine.groups.items() for group in _by_unit(machine, *one))
    automatic = (*levels, *_kinds(sites), *declared, *_sensor_kinds(machine, sites), *_repeated(machine))
    for name, members in (*machine.groups.items(), *automatic):
        if len(members) > 1 and name not in named and not any(set(members) == set(m) for m in named.values()):
            named[name] = members
    return named


Grouped = Iterator[tuple[str, tuple[str, ...]]]


def _by_unit(machine: Machine, name: str, members: tuple[str, ...]) -> Grouped:
    """A group; where drives have several units, what is no drive, and the drives of each unit."""
    turning = {a for a, drive in machine.actuators.items() if drive.turns is not None}
    if not 0 < len(turning) < len(machine.actuators):
        yield name, members
        return
    yield name, tuple(m for m in members if m not in machine.actuators)
    yield f"{name}_{ROTARY}", tuple(m for m in members if m in turning)
    yield f"{name}_{LINEAR}", tuple(m for m in members if m in machine.actuators and m not in turning)


def _repeated(machine: Machine) -> Grouped:
    """Entries that one `each` has made: they stand at one place of the file."""
    for section in ("actuators", "guides", *sections_with("between"), "sensors"):
        by_place: dict[object, list[str]] = {}
        for name in getattr(machine, section):
            path: Path = (section, name)
            by_place.setdefault(machine.source.key(path), []).append(name)
        for members in by_place.values():
            yield "+".join(members), tuple(members)


def _kinds(sites: EffectSites) -> Grouped:
    """Drives of one kind, where there are several kinds."""
    by_kind: dict[str, list[str]] = {}
    for name, (site, *_) in sites.get("command", {}).items():
        by_kind.setdefault(site.kind, []).append(name)
    for kind, members in by_kind.items():
        yield f"{kind}_drives", tuple(members)


def _sensor_kinds(machine: Machine, sites: EffectSites) -> Grouped:
    """Sensors of one kind: often one instrument at several places."""
    by_kind: dict[str, list[str]] = {}
    for name in sites.get("frame", {}):
        by_kind.setdefault(kind_of_sensor(machine.sensors[name]).keyword, []).append(name)
    for kind, members in by_kind.items():
        yield f"{kind}_sensors", tuple(members)


def _levels(machine: Machine, sites: EffectSites) -> Grouped:
    """Those whose base points lie far above the others, and these; each section by itself, under two names."""
    up = 1 if machine.space == "planar" else 2
    base = {name: float(site.at[up]) for name, (site, *_) in sites.get("base", {}).items()}
    upper: list[str] = []
    lower: list[str] = []
    for section in ("actuators", "guides", *sections_with("between")):
        heights = {n: h for n in getattr(machine, section) if np.isfinite(h := _height(machine, base, section, n))}
        order = sorted(heights.values())
        gaps = np.diff(order)
        if not len(gaps) or not gaps.max() > _APART * (order[-1] - order[0]):
            continue
        limit = order[int(gaps.argmax())]
        upper += [n for n, h in heights.items() if h > limit]
        lower += [n for n, h in heights.items() if h <= limit]
    yield UPPER, tuple(upper)
    yield LOWER, tuple(lower)


def _height(machine: Machine, base: Mapping[str, float], section: str, name: str) -> float:
    """Mean height of the base points of a thing, or of what an actuator acts on; nan without any."""
    if name in base:
        return base[name]
    if section == "actuators":
        at = [_height(machine, base, s, t) for s, t in _targets(machine, name)]
    elif section == "bodies":
        at = [base.get(machine.bodies[name].guide or "", np.nan)]
    else:
        at = [base[end] for end in getattr(getattr(machine, section)[name], "between", ()) if end in base]
    known = [h for h in at if np.isfinite(h)]
    return float(np.mean(known)) if known else float("nan")


def _targets(machine: Machine, name: str) -> Iterator[tuple[str, str]]:
    """What an actuator acts on: (section, name)."""
    for key, sections in driven_sections().items():
        driven = getattr(machine.actuators[name], key)
        for target in (driven,) if isinstance(driven, str) else tuple(driven or ()):
            yield from ((section, target) for section in sections if target in getattr(machine, section))
