"""Measurement tables: strict reading and writing of CSV, columns bound to a machine, gross mistakes."""
