"""Numbers that no machine has: sections without area, materials that cannot be, stiffness that comes out negative.

What stands in the file is positive where its field asks for it (`language.checks.magnitudes`); these are computed.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from pkmcal_cli.base.errors import Fault
from pkmcal_cli.compiler.cross_sections import section_properties
from pkmcal_cli.compiler.drives import PlacedDrive
from pkmcal_cli.compiler.paths import path_of
from pkmcal_cli.language.machine import Machine, Material, Section
from pkmcal_cli.mechanism.coefficients import Formula
from pkmcal_cli.mechanism.topology import Group, Topology
from pkmcal_cli.units.limits import HINT, LARGEST, beyond
from pkmcal_cli.yaml_source.tree import Path

_NU = (-1.0, 0.5)  # Poisson's ratio of an isotropic material that is stable
_PARTS = "check its lengths, sections and stiffnesses"


def section_faults(machine: Machine) -> list[Fault]:
    """Faults of sections and materials: an area or moment that is not positive, a Poisson's ratio that cannot be."""
    return [
        *(f for name, section in machine.sections.items() for f in _section(machine, name, section)),
        *(f for name, material in machine.materials.items() for f in _material(machine, name, material)),
    ]


def _section(machine: Machine, name: str, section: Section) -> Iterator[Fault]:
    nominal, units = machine.nominal_values(), machine.file_units.length
    if section.tube is not None:
        outer, inner = (q.number(nominal) for q in section.tube)
        if inner >= outer:
            sizes = f"outer diameter {units.format(outer)}, inner diameter {units.format(inner)}"
            remedy = "exchange the two diameters" if inner > outer else "use `round` for a solid section"
            hint = f"write `tube: [outer, inner]`; {remedy}"
            yield machine.source.fault(
                "value", f"tube `{name}` has no wall thickness: {sizes}", ("sections", name, "tube"), hint
            )
            return
    form = next(f for f in ("square", "rectangle", "round", "tube", "area") if getattr(section, f) is not None)
    for key, of in section_properties(section).items():
        value = float(np.real(of.function(nominal))) if isinstance(of, Formula) else of
        if (wrong := _size(value)) is not None:
            yield machine.source.fault("value", f"{key} of section `{name}` {wrong}", ("sections", name, form), HINT)
            return


def _material(machine: Machine, name: str, material: Material) -> Iterator[Fault]:
    nu = 0.0 if material.nu is None else material.nu.number(machine.nominal_values())
    if not _NU[0] < nu <= _NU[1]:
        message = f"Poisson's ratio of `{name}` is {nu:g}, which no isotropic material can have"
        yield machine.source.fault(
            "value", message, ("materials", name, "nu"), "use a value above -1 and up to 0.5 (steel: 0.3)"
        )


def number_faults(machine: Machine, topology: Topology, drives: list[PlacedDrive]) -> list[Fault]:
    """Faults of what the compiled machine computes with, at nominal parameters."""
    checked = [*_gains(machine, topology, drives), *_stiffnesses(machine, topology)]
    return checked or list(_others(machine, topology))


def _gains(machine: Machine, topology: Topology, drives: list[PlacedDrive]) -> Iterator[Fault]:
    """Drives whose reading moves nothing, or everything."""
    for placed in drives:
        wrong = _size(float(topology.coefficients.constants[placed.gain_coefficient]))
        if wrong is not None:
            message = f"travel per reading of `{placed.drive.name}` {wrong}"
            path = ("actuators", placed.drive.name)
            yield machine.source.fault("value", message, path, "check `scale`, `ratio` and `radius`", at_key=True)


def _stiffnesses(machine: Machine, topology: Topology) -> Iterator[Fault]:
    """Elements whose stiffness is not positive where they yield, each told once."""
    seen: set[Path] = set()
    for group in topology.groups:
        numbers = topology.coefficients.constants[group.stiffness].reshape(len(group.names), -1)
        for p, strains in _own_patterns(group):
            for e in np.nonzero(~group.rigid[:, strains].all(axis=1))[0]:
                value = float(numbers[e, p])
                wrong = _size(value) or (f"is {value:.3g}, but must be positive" if value < 0 else None)
                path = path_of(machine, name := group.names[e])
                if wrong is not None and path not in seen:
                    seen.add(path)
                    message = f"stiffness of `{name}` ({group.element.strains[strains[0]]}) {wrong}"
                    yield machine.source.fault("value", message, path, _PARTS, at_key=True)


def _own_patterns(group: Group) -> Iterator[tuple[int, list[int]]]:
    """Numbers of stiffness that stand on the diagonal, with their strains; the others are couplings."""
    for p, pattern in enumerate(group.element.patterns):
        strains = np.nonzero(np.diag(pattern))[0].tolist()
        if strains:
            yield p, strains


def _others(machine: Machine, topology: Topology) -> Iterator[Fault]:
    """Anything else that is computed and cannot be computed with: weights, places, forces."""
    for label, value in zip(topology.coefficients.labels, topology.coefficients.constants.tolist(), strict=True):
        if not abs(value) <= LARGEST:
            message = f"{label} is out of range: {value:.3g} in SI units"
            yield machine.source.fault("value", message, path_of(machine, label), HINT, at_key=True)


def _size(value: float) -> str | None:
    """What is wrong with a number that must not be zero."""
    if value == 0 or not np.isfinite(value):
        return f"is {value:g}"
    wrong = beyond(value)
    return None if wrong is None else f"is {value:.3g} in SI units, {wrong}"
