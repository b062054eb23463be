"""Look-alikes of real campaigns: one known cause, or two, in a table as it comes from a shop. SI units."""
