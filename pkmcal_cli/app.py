"""The command-line program: runs the subcommand, turns errors into text and exit codes (0, 1, 2, 3, 4, 70, 130)."""

from __future__ import annotations

import gc
import os
import signal
import sys
import traceback
import warnings
from contextlib import suppress
from itertools import pairwise

import typer

from pkmcal_cli import __version__
from pkmcal_cli.base.styles import styled, wants_styles
from pkmcal_cli.base.visible import visible
from pkmcal_cli.commands._group import Subcommands, names

_STOPPED = 130
_GARBAGE = 50_000  # objects between looks for garbage: the many that modules make at the start are none
_THREADS = ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS", "BLIS_NUM_THREADS", "VECLIB_MAXIMUM_THREADS")

app = typer.Typer(
    name="pkmcal",
    cls=Subcommands,
    help="Calibrate parallel kinematic machines: geometry and elasticity from measurements.",
    no_args_is_help=True,
    rich_markup_mode=None,
    context_settings={"help_option_names": ["-h", "--help"]},
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


def main() -> None:
    """Run the program and end the process."""
    gc.set_threshold(_GARBAGE)
    os.environ.update(dict.fromkeys(_THREADS, "1"))  # before there is any linear algebra: sums do not depend on it
    _stop_on_signals()
    code = run(sys.argv[1:])
    gc.freeze()  # what is left lives to the end: a last look for garbage among all modules takes as long as a small fit
    sys.exit(code)


def _stop_on_signals() -> None:
    """Who is asked to end, or loses the terminal, ends as by Ctrl-C: no torn file, exit code 130."""

    def stop(*_: object) -> None:
        for each in kinds:
            signal.signal(each, signal.SIG_IGN)  # the end is on its way, and tidies up
        raise KeyboardInterrupt

    named = (getattr(signal, name, None) for name in ("SIGTERM", "SIGHUP"))
    kinds = [s for s in named if s is not None and signal.getsignal(s) is not signal.SIG_IGN]  # nohup ignores
    for each in kinds:
        signal.signal(each, stop)


def run(arguments: list[str]) -> int:
    """Run the program with arguments; returns the exit code, never a traceback for what the user can mend."""
    _open_streams()
    if not os.environ.get("PKMCAL_DEBUG"):
        warnings.simplefilter("ignore")  # a row without a solution is told in our own words
    try:
        code = int(app(arguments, prog_name="pkmcal", standalone_mode=False) or 0)
        _flush()
        if code == _STOPPED:
            _tell("stopped")
        return code
    except (KeyboardInterrupt, typer.Abort):
        _leave_stdout()
        _tell("stopped")
        return _STOPPED
    except SystemExit as end:  # typer's answer to a shell that asks for completions, or to a reader that has gone
        _leave_stdout()
        return 0 if end.code in (0, None) else 4
    except Exception as error:
        _leave_stdout()
        if _is_stop(error):
            _tell("stopped")
            return _STOPPED
        return _failed(error, arguments)


def _is_stop(error: BaseException) -> bool:
    """Whether Ctrl-C is behind an error: while a module is imported, Python 3.11 makes a RuntimeError of it."""
    while error.__cause__ is not None:
        error = error.__cause__
    return isinstance(error, KeyboardInterrupt)


def _failed(error: Exception, arguments: list[str]) -> int:
    """Tell an error; its exit code."""
    from pkmcal_cli.base.errors import BadInput, Location, OutputError, PkmcalError, numbers_fail, too_large

    if isinstance(error, OSError) and error.filename is None:  # typer's own output, such as help
        error = OutputError(f"cannot be written: {error.strerror or error}", "<stdout>")
    elif isinstance(error, OSError):  # of a file that was looked at: results have their own words
        message = f"the file cannot be read: {error.strerror or error}"
        error = BadInput.single(message, Location(str(error.filename), 1), "check the path and the rights", "file")
    if isinstance(error.__cause__, BrokenPipeError):
        return OutputError.exit_code  # the reader has gone: nobody wants to know
    if type(error).__name__ == "LinAlgError":
        error = numbers_fail()
    if isinstance(error, MemoryError):
        error = too_large()
    if isinstance(error, PkmcalError):
        if os.environ.get("PKMCAL_DEBUG"):
            _tell("".join(traceback.format_exception(error)))
        _tell(error.text())
        if _annotated(arguments):
            from pkmcal_cli.base.annotations import of_error

            _tell("\n".join(of_error(error)))
        return error.exit_code
    return _usage_or_internal(error, arguments)


def _annotated(arguments: list[str]) -> bool:
    """Whether errors are wanted as annotations of files too."""
    return "--format=github" in arguments or ("--format", "github") in pairwise(arguments)


def _open_streams() -> None:
    """Streams that the caller has closed: nothing to read, nowhere to write (an error for results)."""
    if sys.stdin is None:
        sys.stdin = os.fdopen(os.open(os.devnull, os.O_RDONLY), encoding="utf-8")
    if sys.stderr is None:
        sys.stderr = os.fdopen(os.open(os.devnull, os.O_WRONLY), "w", encoding="utf-8")
    if sys.stdout is None:
        sys.stdout = os.fdopen(os.open(os.devnull, os.O_RDONLY), "w", encoding="utf-8")  # writing fails
    for stream in (sys.stdout, sys.stderr):
        if hasattr(stream, "reconfigure"):
            stream.reconfigure(encoding="utf-8", errors="backslashreplace")


def _usage_or_internal(error: Exception, arguments: list[str]) -> int:
    """Errors of the command line's syntax exit with 2; anything unforeseen with 70."""
    from pkmcal_cli.base.errors import PkmcalError, UsageError

    message = getattr(error, "format_message", None)
    if message is None or not hasattr(error, "exit_code"):
        if os.environ.get("PKMCAL_DEBUG"):
            raise error
        internal = f"internal error: {type(error).__name__}: {error}"
        _tell(f"{internal}\nhelp: run again with PKMCAL_DEBUG=1 and report the trace")
        return PkmcalError.exit_code
    if type(error).__name__ == "NoArgsIsHelpError":
        _tell(str(message()))
    else:
        command = " ".join(["pkmcal", *(a for a in arguments[:1] if a in names())])
        _tell(UsageError(str(message()).strip().rstrip("."), hint=f"see `{command} --help`").text())
    return UsageError.exit_code


def _tell(text: str) -> None:
    """A message for people; a closed stderr is no reason for another error."""
    text = visible(text)
    with suppress(OSError, ValueError):
        print(styled(text) if wants_styles(sys.stderr) else text, file=sys.stderr, flush=True)


def _flush() -> None:
    """What stands in stdout's buffer must be written before the exit code is known."""
    try:
        sys.stdout.flush()
    except OSError as error:
        from pkmcal_cli.base.errors import OutputError

        raise OutputError(f"cannot be written: {error.strerror or error}", "<stdout>") from error


def _leave_stdout() -> None:
    """Keep the interpreter from complaining at its end about what stdout could not take."""
    try:
        sys.stdout.flush()
    except (OSError, ValueError, AttributeError):
        with suppress(OSError, ValueError, AttributeError):
            os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
