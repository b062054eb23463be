"""The subcommands: every public module of this folder is one, its function of the module's name.

The module of a command is imported when the command is named, or all are listed: starting does not wait for the others.
"""

from __future__ import annotations

import os
from collections.abc import Callable
from importlib import import_module
from typing import Any

import typer
from typer.core import TyperCommand, TyperGroup

_FOLDER = os.path.dirname(__file__)


def names() -> list[str]:
    """Names of all commands."""
    files = (file for file in os.listdir(_FOLDER) if file.endswith(".py") and not file.startswith("_"))
    return sorted(file.removesuffix(".py") for file in files)


class Subcommands(TyperGroup):
    """Knows all commands by name, their questions when they are listed, and the one that is named wholly."""

    def __init__(self, **settings: Any) -> None:
        super().__init__(**settings)
        for name in names():
            self.add_command(TyperCommand(name))

    def format_commands(self, ctx: Any, formatter: Any) -> None:
        """The list of all in the help."""
        for name, command in self.commands.items():
            command.help = _function(name).__doc__
        super().format_commands(ctx, formatter)

    def resolve_command(self, ctx: Any, args: list[str]) -> tuple[str | None, Any, list[str]]:
        """The command that is named on the command line."""
        name, command, rest = super().resolve_command(ctx, args)
        return name, command if name is None else _whole(name), rest


def _function(name: str) -> Callable[..., None]:
    function: Callable[..., None] = getattr(import_module(f"pkmcal_cli.commands.{name}"), name)
    return function


def _whole(name: str) -> object:
    """A command with its arguments, options and help; its example stands last."""
    function, alone = _function(name), typer.Typer(rich_markup_mode=None, add_completion=False)
    text, _, example = (function.__doc__ or "").partition("Example:")
    alone.command(name, help=text.rstrip(), epilog=f"\b\nExample:\n  {example.strip()}")(function)
    return typer.main.get_command(alone)
