"""Elasto-geometrical calibration of parallel kinematic machines."""

__version__ = "0.1.0"
