"""Consistency of a machine as written: references, dimensions, magnitudes, shapes."""
