"""Independent simulators of the shipped machines: minima of a potential energy, no code shared with
pkmcal."""
