"""Units of measurement, dimensions, and which numbers can be computed with."""
