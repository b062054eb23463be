"""YAML with places: what stands where in which file."""
