"""The machine file: YAML with places, units, expressions, and the machine as frozen models."""
