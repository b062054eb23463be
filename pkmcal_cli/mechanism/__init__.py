"""The mechanism without numbers: coordinates, bodies, connections, coefficients, what depends on what."""
