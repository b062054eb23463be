"""Numbers that do not fit each other, whatever the machine's size: one of them may be in another unit.

Each limit is of mechanics or beyond what is built; docs/decisions.md says why.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence

from pkmcal_cli.base.errors import Fault
from pkmcal_cli.language.machine import Machine, Material, Section
from pkmcal_cli.loading.doubts import Band, Doubts, Number, numbers_of
from pkmcal_cli.units.dimensions import LENGTH

_LIKE = 100.0  # ratio of a stiffness to the median of its kind
_ONE_GUIDE = 1e3 * (1 - 1e-9)  # ratio of stiffnesses of one guide or joint
_COMPOUND = 500.0  # I/A^2: tubes up to 50, lattices ten times that
_SOLID, _BLADE = 0.02, 1e-4  # least sqrt(Iy*Iz)/A^2, of a disc 0.08; of one alone, which may be that of a leaf spring
_OPEN = 0.05 / 40  # least J*Ip/A^4; 1/40 of solid sections (Saint-Venant), some times less of branched ones
_STIFF_MATERIAL = 50e9  # Pa: softer ones may be laminates, whose shear modulus is what their fibres make it
_FIBRES = 100.0  # E/G: along fibres up to 50
_STRAIN = 0.05  # of ropes and belts under a force that is commanded
_DIRECTIONS = (("radial", "x", "y", "z"), ("rx", "ry", "rz"))
_FINE, _STEPS = 3e-3, 1e3  # extents beside the machine's size; readings of the finest instrument in them
_EXTENT = 10.0  # of the machine's size


def unlike_figures(doubts: Doubts, size: float) -> Iterator[Fault]:
    """Warnings of a machine; `size`: its own, m."""
    machine = doubts.machine
    for name, material in machine.materials.items():
        yield from _material(doubts, name, material)
    for name, section in machine.sections.items():
        yield from _section(doubts, name, section)
    yield from _unlike(doubts)
    yield from _strain(doubts)
    yield from _workspace(doubts, size)


def _material(doubts: Doubts, name: str, material: Material) -> Iterator[Fault]:
    """The shear modulus beside E: nu = E/(2G) - 1 is positive, and below 0.5 but for fibres."""
    modulus = material.E.number(doubts.values)
    stiffest = 0.5 * modulus * (1 + 1e-9) if modulus >= _STIFF_MATERIAL else math.inf
    hint = f"G = E/(2(1 + nu)): with this E and nu = 0.3 it would be {modulus / 2.6e9:.3g} GPa"
    for shear in numbers_of(("materials", name), material, ("G",)):
        yield from doubts.outside(shear, (modulus / _FIBRES, stiffest), hint)


def _section(doubts: Doubts, name: str, section: Section) -> Iterator[Fault]:
    """Area and moments: of one shape."""
    path = ("sections", name)
    area = next(numbers_of(path, section, ("area",)), None)
    moments = sorted(numbers_of(path, section, ("Iy", "Iz")), key=doubts.size)
    if area is None or not moments or not doubts.size(area) or not doubts.size(moments[0]):
        return
    square, small, large = doubts.size(area) ** 2, doubts.size(moments[0]), doubts.size(moments[-1])
    shape = f"I/A^2 of {name} = {small / square:.3g}"
    hint = f"check the units of area, Iy and Iz: {shape}; it is 0.08 of a solid bar and up to 50 of a thin tube"
    if small > _COMPOUND * square:
        yield doubts.of_number(area, (math.sqrt(large / _COMPOUND), math.sqrt(12.0 * small)), hint)
    elif large > _COMPOUND * square:
        yield doubts.of_number(moments[-1], (small, _COMPOUND * square), hint)
    elif len(moments) == 1 and small < _BLADE * square:
        yield doubts.of_number(moments[0], (_SOLID * square, _COMPOUND * square), hint)
    elif len(moments) == 2 and small * large < (_SOLID * square) ** 2:
        yield doubts.of_number(moments[0], ((_SOLID * square) ** 2 / large, _COMPOUND * square), hint)
    elif len(moments) == 2:
        polar = small + large
        hint = "check the unit: J is Iy + Iz of a round section and less of all others"
        for torsion in numbers_of(path, section, ("J",)):
            yield from doubts.outside(torsion, (_OPEN * square**2 / polar, 2.0 * polar), hint)


def _unlike(doubts: Doubts) -> Iterator[Fault]:
    """Stiffnesses far from those of their kind, but of springs, and those of one guide or joint from each other."""
    machine = doubts.machine
    for kind, keys in (("bars", "k EA"), ("ropes", "k EA"), ("telescopes", "k EA"), ("actuators", "stiffness")):
        for key in keys.split():
            members = ((n, m) for n, m in getattr(machine, kind, {}).items() if not getattr(m, "spring", False))
            numbers = [n for name, member in members for n in numbers_of((kind, name), member, (key,))]
            for dimension in dict.fromkeys(number.quantity.dimension for number in numbers):
                yield from _among_like(doubts, [n for n in numbers if n.quantity.dimension == dimension])
    for numbers in _of_one(machine):
        yield from _in_one(doubts, numbers)


def _among_like(doubts: Doubts, numbers: Sequence[Number]) -> Iterator[Fault]:
    median = sorted(map(doubts.size, numbers))[len(numbers) // 2]
    for number in numbers if len(numbers) > 2 else ():
        yield from doubts.outside(number, (median / _LIKE, median * _LIKE))


def _of_one(machine: Machine) -> Iterator[list[Number]]:
    """Stiffnesses of one guide or joint; one that blocks all directions may be a flexure, soft in some of them."""
    guides = [("guides", name, guide.stiffness) for name, guide in machine.guides.items()]
    joints = [("joints", name, joint.stiffness) for name, joint in machine.joints.items() if joint.type != "fixed"]
    for kind, name, stiffness in (*guides, *joints):
        for keys in _DIRECTIONS:
            those = numbers_of((kind, name, "stiffness"), stiffness, keys)
            yield [Number(f"stiffness {number.path[-1]} of {name}", number.path, number.quantity) for number in those]


def _in_one(doubts: Doubts, numbers: Sequence[Number]) -> Iterator[Fault]:
    """The one that is further from the middle of all, where they differ too much."""
    ordered = [number for number in sorted(numbers, key=doubts.size) if doubts.size(number)]
    if len(ordered) < 2 or doubts.size(ordered[-1]) < _ONE_GUIDE * doubts.size(ordered[0]):
        return
    middle = doubts.size(ordered[len(ordered) // 2])
    odd, others = ordered[0], ordered[1:]
    if doubts.size(ordered[-1]) / middle > middle / doubts.size(odd):
        odd, others = ordered[-1], ordered[:-1]
    band: Band = (doubts.size(others[-1]) / _ONE_GUIDE, doubts.size(others[0]) * _ONE_GUIDE)
    hint = "check the unit: other directions of it are more than a thousand times stiffer or softer"
    yield doubts.of_number(odd, band, hint)


def _strain(doubts: Doubts) -> Iterator[Fault]:
    """Commanded forces that would strain what they pull."""
    machine = doubts.machine
    for name, actuator in machine.actuators.items():
        force = actuator.force.otherwise if actuator.force is not None else None
        if force is None or actuator.control != "force":
            continue
        for rope in actuator.winds or ():
            for stiffness in numbers_of(("ropes", rope), machine.ropes[rope], ("EA",)):
                least, number = doubts.size(stiffness), Number(f"force of {name}", ("actuators", name, "force"), force)
                hint = f"check the unit: it strains {rope} by {100 * doubts.size(number) / least:.3g} %"
                yield from doubts.outside(number, (0.0, _STRAIN * least), hint)


def _workspace(doubts: Doubts, size: float) -> Iterator[Fault]:
    """Angles beyond what a turn can be, and extents in which the instruments tell hardly any places apart."""
    machine, box = doubts.machine, doubts.machine.workspace and doubts.machine.workspace.box
    most = math.pi if machine.space == "spatial" else 2.0 * math.pi  # in space a larger turn is a smaller one back
    for limit in numbers_of(("workspace", "box"), box, ("rx", "ry", "rz")):
        unit = machine.file_units.angle
        if doubts.size(limit) > most * (1 + 1e-9):
            number = doubts.size(limit) / unit.scale
            reach = "half a turn" if machine.space == "spatial" else "a turn"
            message = f"{limit.path[-1]} of the workspace reaches to {number:g} {unit.text}, more than {reach}"
            message += f": did you mean {number:g} deg?" if unit.scale == 1.0 else ""
            hint = f"bare angles are in {unit.text}; write `{number:g} deg`"
            yield doubts.fault("magnitude", message, limit.path, hint)
            break
    sigmas = [s.constant for each in machine.sensors.values() for s in each.sigma.values()]
    finest = min((s.number(doubts.values) for s in sigmas if s.dimension == LENGTH), default=0.0)
    limits = {key: getattr(box, key, None) for key in "xyz"}
    extents = {k: ends[1].number(doubts.values) - ends[0].number(doubts.values) for k, ends in limits.items() if ends}
    thin = {key: extent for key, extent in extents.items() if extent < min(_FINE * size, _STEPS * finest)}
    if len(thin) > 1:  # of one coordinate it is a plane, to be kept to
        key, extent = next(iter(thin.items()))
        band: Band = (_FINE * size, _EXTENT * size)
        yield doubts.of_value(f"workspace along {key}", ("workspace", "box", key), extent, LENGTH, band)
