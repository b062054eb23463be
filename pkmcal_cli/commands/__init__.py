"""Subcommands, one module each: read, call one function, write."""
