"""Expressions in machine files: parsed, differentiated, evaluated."""
