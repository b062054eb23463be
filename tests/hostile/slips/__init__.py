"""Slips that engineers make by hand, each with the message that must come of it."""
