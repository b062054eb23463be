"""The compiler: a machine file's declarations become the index arrays and coefficients of the engine."""

from pkmcal_cli.compiler.build import Compiled, compile_machine

__all__ = ["Compiled", "compile_machine"]
