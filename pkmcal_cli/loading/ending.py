"""How the fit ended that wrote a parameter file, as its `provenance` holds it, and what every reader of it is told."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from pkmcal_cli.yaml_source.tree import SourceNode

_IMPLAUSIBLE, _ACCEPTED = "implausible", "accepted"


@dataclass(frozen=True)
class Ending:
    """The status of a fit, None where a file does not say; why it is implausible, and whether that was accepted."""

    status: str | None = None
    reasons: tuple[str, ...] = ()
    accepted: bool = False

    def remarks(self, file: str) -> tuple[str, ...]:
        """A note or warning of a file, for a fit that did not end well or leaves more than noise; () for others."""
        if self.status in (None, "converged"):
            return ()
        if self.status == "incomplete":
            hint = "(`pkmcal diagnose` looks for the cause)"
            return (f"note: {file}: incomplete: residuals exceed the stated noise {hint}",)
        why = "; ".join(self.reasons)
        if self.accepted:
            return (f"note: {file}: implausible, but accepted: {why}",)
        return (f"warning: {file}: the fit ended with status `{self.status}`{f': {why}' if why else ''}",)


    @property
    def believed(self) -> bool:
        """Whether nobody has to doubt what is kept of the file, or somebody has accepted it."""
        return self.accepted or self.status in (None, "converged", "incomplete")


def provenance_of_doubts(reasons: Sequence[str], accepted: bool) -> dict[str, Any]:
    """Entries of a provenance, of a fit that is implausible for some reasons; {} without."""
    if not reasons:
        return {}
    return {_IMPLAUSIBLE: list(reasons)} | ({_ACCEPTED: list(reasons)} if accepted else {})


def read_ending(root: SourceNode) -> Ending:
    """Of a parameter file."""
    provenance = root.child("provenance")
    status = None if provenance is None else provenance.child("status")
    accepted, reasons = _reasons(provenance, _ACCEPTED), _reasons(provenance, _IMPLAUSIBLE)
    return Ending(None if status is None else str(status.value), accepted or reasons, bool(accepted))


def _reasons(provenance: SourceNode | None, key: str) -> tuple[str, ...]:
    node = None if provenance is None else provenance.child(key)
    plain = None if node is None else node.plain()
    return tuple(str(reason) for reason in plain) if isinstance(plain, list | tuple) else ()
