"""The subcommands: every public module of this folder is one, its function of the module's name.

The module of a command is imported when the command is named, or all are listed: starting does not wait for the others.
"""

from __future__ import annotations

import os
import re
from collections.abc import Callable
from functools import cache
from importlib import import_module
from typing import Any

import typer
from typer.core import TyperCommand, TyperGroup

_FOLDER = os.path.dirname(__file__)
ORDER = (
    ("new", "check", "draw"),
    ("simulate", "sensitivity", "observability", "plan"),
    ("calibrate", "diagnose", "improve"),
    ("correct", "report", "compare"),
    ("study",),
    ("effects", "schema"),
)
"""The order of work: commands in groups; those that are in none come last."""


def names() -> list[str]:
    """Names of all commands, in the order of work."""
    files = (file for file in os.listdir(_FOLDER) if file.endswith(".py") and not file.startswith("_"))
    there, known = {file.removesuffix(".py") for file in files}, [name for group in ORDER for name in group]
    return [*(name for name in known if name in there), *sorted(there.difference(known))]


class Subcommands(TyperGroup):
    """Knows all commands by name, their questions when they are listed, and the one that is named wholly."""

    def __init__(self, **settings: Any) -> None:
        super().__init__(**settings)
        for name in names():
            self.add_command(TyperCommand(name))

    def list_commands(self, ctx: Any) -> list[str]:
        """Their names, in the order of work."""
        return list(self.commands)

    def format_commands(self, ctx: Any, formatter: Any) -> None:
        """The list of all in the help: the whole question of each, a blank line between groups."""
        groups = [[name for name in group if name in self.commands] for group in ORDER]
        groups.append([name for name in self.commands if not any(name in group for group in groups)])
        widest = max(map(len, self.commands))
        with formatter.section("Commands"):
            for k, group in enumerate(filter(None, groups)):
                formatter.write("\n" if k else "")
                formatter.write_dl([(name.ljust(widest), _question(name)) for name in group])

    def resolve_command(self, ctx: Any, args: list[str]) -> tuple[str | None, Any, list[str]]:
        """The command that is named on the command line."""
        name, command, remaining = super().resolve_command(ctx, args)
        if name is None:
            return name, command, remaining
        whole = _whole(name, _function(name))
        if not ctx.resilient_parsing:  # which proposes words
            _check_once(whole, remaining)
        return name, whole, remaining


def _check_once(command: Any, words: list[str]) -> None:
    """Whether no option with one value is there with several: the last would count. Raises UsageError."""
    options = words[: words.index("--")] if "--" in words else words
    single = [p for p in command.params if isinstance(p, typer.core.TyperOption) and not (p.multiple or p.is_flag)]
    for one in single:
        values = set()
        for k, word in enumerate(options):
            name, equals, value = word.partition("=")
            if name in one.opts:
                values.add(value if equals else "".join(options[k + 1 : k + 2]))
        if len(values) > 1:
            from pkmcal_cli.base.errors import UsageError

            raise UsageError(f"{one.opts[-1]} is given twice", hint="give it once")


def _function(name: str) -> Callable[..., None]:
    function: Callable[..., None] = getattr(import_module(f"pkmcal_cli.commands.{name}"), name)
    return function


def _question(name: str) -> str:
    """The first paragraph of a command's help."""
    return " ".join((_function(name).__doc__ or "").partition("\n\n")[0].split())


@cache
def _whole(name: str, function: Callable[..., None]) -> object:
    """A command with its arguments, options and help; its examples stand last."""
    alone = typer.Typer(rich_markup_mode=None, add_completion=False)
    text, _, examples = re.sub(r"(?m)^    ", "", function.__doc__ or "").partition("Examples:")
    lines = "\n".join(f"  {line.removeprefix('    ').rstrip()}" for line in examples.strip("\n ").splitlines())
    alone.command(name, help=text.rstrip(), epilog=f"\b\nExamples:\n{lines}")(function)
    return typer.main.get_command(alone)
