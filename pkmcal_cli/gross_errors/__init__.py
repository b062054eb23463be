"""Gross errors of measurement: swapped columns, wrong units and signs, rows that repeat or do not fit."""
