"""Messages as GitHub shows them beside the lines of files: workflow commands, one line each.

Syntax: https://docs.github.com/en/actions/reference/workflow-commands-for-github-actions (setting an error message).
"""

from __future__ import annotations

from typing import Literal

from pkmcal_cli.base.errors import BadInput, Fault, Location, PkmcalError

Severity = Literal["error", "warning"]
FORMATS = ("text", "github")


def annotation(severity: Severity, message: str, where: Location | None = None, title: str = "") -> str:
    """`::error file=M.yaml,line=3,col=5,title=unit::message`."""
    named = {} if where is None else {"file": where.file, "line": where.line or "", "col": where.column or ""}
    parts = {**named, "title": title}
    properties = ",".join(f"{key}={_property(str(value))}" for key, value in parts.items() if value)
    return f"::{severity}{' ' if properties else ''}{properties}::{_escaped(message)}"


def of_fault(fault: Fault) -> str:
    """A fault with its remedy."""
    text = f"{fault.what}\nhelp: {fault.hint}" if fault.hint else fault.what
    return annotation(fault.severity, text, fault.where, fault.code)


def of_error(error: PkmcalError) -> list[str]:
    """What ends a run: all faults of bad input."""
    if isinstance(error, BadInput):
        return [of_fault(fault) for fault in error.faults]
    named = isinstance(error.where, str)
    message = f"{error.where}: {error.what}" if named else error.what
    return [of_fault(Fault(error.code, message, None if isinstance(error.where, str) else error.where, error.hint))]


def _escaped(text: str) -> str:
    """Commands end with the line, so line breaks are escaped."""
    return text.replace("%", "%25").replace("\r", "%0D").replace("\n", "%0A")


def _property(text: str) -> str:
    return _escaped(text).replace(":", "%3A").replace(",", "%2C")
