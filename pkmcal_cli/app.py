"""The command-line program: finds the subcommands, turns errors into text and exit codes (0, 1, 2, 3, 4, 70, 130)."""

from __future__ import annotations

import importlib
import pkgutil
import sys

import typer

from . import __version__, commands
from .errors import PkmcalError

app = typer.Typer(
    name="pkmcal",
    help="Calibrate parallel kinematic machines: geometry and elasticity from measurements.",
    no_args_is_help=True,
    rich_markup_mode=None,
    add_completion=False,
    pretty_exceptions_enable=False,
)


def _show_version(value: bool) -> None:
    if value:
        typer.echo(f"pkmcal {__version__}")
        raise typer.Exit


@app.callback()
def _root(
    version: bool = typer.Option(False, "--version", callback=_show_version, is_eager=True, help="Show the version."),
) -> None:
    del version


def _register() -> None:
    """Every public module of `commands` is a subcommand: its function of the module's name."""
    for module in sorted(m.name for m in pkgutil.iter_modules(commands.__path__)):
        if not module.startswith("_"):
            function = getattr(importlib.import_module(f"{commands.__name__}.{module}"), module)
            app.command(name=module)(function)


_register()


def main() -> None:
    """Run the program; never a traceback for what the user can mend."""
    try:
        sys.exit(app(standalone_mode=False) or 0)
    except PkmcalError as error:
        _tell(error.text())
        sys.exit(error.exit_code)
    except (KeyboardInterrupt, typer.Abort):
        _tell("stopped")
        sys.exit(130)
    except BrokenPipeError:
        _close_stdout()
        sys.exit(4)
    except MemoryError:
        _tell("error[memory]: not enough memory")
        sys.exit(70)
    except Exception as error:
        _usage_or_internal(error)


def _usage_or_internal(error: Exception) -> None:
    """Errors of the command line's syntax exit with 2; anything unforeseen with 70."""
    show = getattr(error, "show", None)
    if show is not None and hasattr(error, "exit_code"):
        show(file=sys.stderr)
        sys.exit(int(error.exit_code))
    import os

    if os.environ.get("PKMCAL_DEBUG"):
        raise error
    _tell(f"internal error: {type(error).__name__}: {error}\nhelp: run again with PKMCAL_DEBUG=1 and report the trace")
    sys.exit(70)


def _tell(text: str) -> None:
    print(text, file=sys.stderr)


def _close_stdout() -> None:
    """Keep the interpreter from complaining about a reader that has gone."""
    import os

    os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
