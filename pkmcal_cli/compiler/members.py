"""All elements of a machine as links, section by section: a new kind of element is put together here."""

from __future__ import annotations

from pkmcal_cli.compiler.bars import add_bars
from pkmcal_cli.compiler.beams import add_beams
from pkmcal_cli.compiler.drives import leg_lengths
from pkmcal_cli.compiler.joints import add_guides, add_joints
from pkmcal_cli.compiler.ropes import add_ropes
from pkmcal_cli.compiler.structure import Structure
from pkmcal_cli.compiler.weights import Weight


def add_members(structure: Structure) -> list[Weight]:
    """Link what the sections of the machine file join; returns the lumped masses of these."""
    weights = add_beams(structure)
    lengths = leg_lengths(structure)
    weights += add_bars(structure, lengths)
    weights += add_ropes(structure, lengths)
    add_joints(structure)
    add_guides(structure)
    return weights
