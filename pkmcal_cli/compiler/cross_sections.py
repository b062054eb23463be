"""Stiffness and mass of beams from their sections and materials."""

from __future__ import annotations

import numpy as np

from pkmcal_cli.compiler.coefficient_values import combined, number
from pkmcal_cli.compiler.structure import Structure
from pkmcal_cli.language.machine import Beam as BeamSpec
from pkmcal_cli.language.machine import Material, Section
from pkmcal_cli.language.quantities import Quantity
from pkmcal_cli.mechanism.connection_points import Number


def beam_stiffness(structure: Structure, beam: BeamSpec, length: Number) -> list[Number | None]:
    """EA/L, (GJ/L, EIy/L,) EIz/L; None where that deformation is rigid."""
    machine = structure.machine
    section = machine.sections[beam.section] if beam.section else None
    material = machine.materials[beam.material] if beam.material else None
    products: dict[str, Number | None] = {
        "EA": None if beam.EA is None else number(beam.EA),
        "EIy": None if (beam.EIy or beam.EI) is None else number(beam.EIy or beam.EI),
        "EIz": None if (beam.EIz or beam.EI) is None else number(beam.EIz or beam.EI),
        "GJ": None if beam.GJ is None else number(beam.GJ),
    }
    if section is not None and material is not None:
        shape = section_properties(section)
        for key, of in (("EA", "A"), ("EIy", "Iy"), ("EIz", "Iz")):
            if products[key] is None and of in shape:
                products[key] = combined(lambda e, a: e * a, material.E, shape[of])
        if products["GJ"] is None and "J" in shape:
            products["GJ"] = combined(lambda g, j: g * j, shear_modulus(material), shape["J"])
    order = ["EA", "EIz"] if structure.planar else ["EA", "GJ", "EIy", "EIz"]
    return [None if products[k] is None else combined(lambda p, l: p / l, products[k], length) for k in order]  # type: ignore[arg-type]


def shear_modulus(material: Material) -> Number:
    """G, or E / (2 (1 + nu)) with nu = 0.3 by default."""
    if material.G is not None:
        return number(material.G)
    nu = number(material.nu, 0.3)
    return combined(lambda e, n: e / (2 * (1 + n)), material.E, nu)


def section_properties(section: Section) -> dict[str, Number]:
    """A (m^2), Iy, Iz, J (m^4); squares and rectangles twist by Saint-Venant's series (Roark, table 10.1)."""
    if section.square is not None:
        return _rectangle(section.square, section.square)
    if section.rectangle is not None:
        return _rectangle(*section.rectangle)
    if section.round is not None:
        return _tube(section.round, Quantity.constant(0.0))
    if section.tube is not None:
        return _tube(*section.tube)
    out: dict[str, Number] = {}
    for key, value in (("A", section.area), ("Iy", section.Iy), ("Iz", section.Iz), ("J", section.J)):
        if value is not None:
            out[key] = number(value)
    return out


def _rectangle(b: Quantity, h: Quantity) -> dict[str, Number]:
    def torsion(p: complex, q: complex) -> complex:
        long, short = (p, q) if np.real(p) >= np.real(q) else (q, p)
        r = short / long
        return long * short**3 * (1 / 3 - 0.21 * r * (1 - r**4 / 12))

    return {
        "A": combined(lambda p, q: p * q, b, h),
        "Iy": combined(lambda p, q: p * q**3 / 12, b, h),
        "Iz": combined(lambda p, q: q * p**3 / 12, b, h),
        "J": combined(torsion, b, h),
    }


def _tube(outer: Quantity, inner: Quantity) -> dict[str, Number]:
    area = combined(lambda d, e: np.pi / 4 * (d**2 - e**2), outer, inner)
    second = combined(lambda d, e: np.pi / 64 * (d**4 - e**4), outer, inner)
    return {"A": area, "Iy": second, "Iz": second, "J": combined(lambda i: 2 * i, second)}


def beam_mass(structure: Structure, beam: BeamSpec, length: Number) -> Number | None:
    """Mass in kg: given, or density times volume; None where neither is known."""
    if beam.mass is not None:
        return number(beam.mass)
    material = structure.machine.materials[beam.material] if beam.material else None
    section = structure.machine.sections[beam.section] if beam.section else None
    if material is None or section is None or material.density is None:
        return None
    area = section_properties(section)["A"]
    return combined(lambda r, a, l: r * a * l, material.density, area, length)
