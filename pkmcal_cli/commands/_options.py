"""Options that several commands share."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import fields
from typing import Annotated, Any, TypeVar, cast

import typer

from pkmcal_cli.commands import _completion

Record = TypeVar("Record")


def as_request(kind: type[Record], options: Mapping[str, Any], **fixed: Any) -> Record:
    """A record whose fields are options of a command, by their names; lists, which may be absent, as tuples."""
    chosen = {f.name: options[f.name] for f in fields(cast(Any, kind)) if f.name not in fixed}
    return kind(**{name: tuple(v) if isinstance(v, list) else v for name, v in chosen.items()}, **fixed)


def choice(name: str, words: str, text: str) -> Any:
    """An option that is one of some words, `exact|linear`, which the shell proposes; text: its help."""
    return typer.Option(name, metavar=words, help=text, autocompletion=_completion.one_of(*words.split("|")))


def _machine(text: str) -> str:
    """The file of a shipped machine that is called by its name; other texts are files."""
    from pkmcal_cli.base.shipped import machine_file

    return machine_file(text)


MachineFile = Annotated[
    str,
    typer.Argument(
        metavar="MACHINE.yaml", help="Machine file, or the name of a shipped one; - is stdin.", callback=_machine
    ),
]
MachineOrRun = Annotated[
    str,
    typer.Argument(
        metavar="M.yaml|RUN",
        help="Machine file or name, or a folder kept by `--run` (then no MEAS.csv).",
        callback=_machine,
    ),
]
PosesFile = Annotated[
    str | None, typer.Argument(metavar="POSES.csv", help="Actuator positions or TCP coordinates; - is stdin.")
]
MeasuredFiles = Annotated[
    list[str], typer.Argument(metavar="MEAS.csv", help="Measured rows, each file a session; - is stdin.")
]
_GRID = (
    'Instead of a file: "x=0:950:3,y=160:390:77" (start:stop:count, ends included); or 40: so many poses over the '
    "workspace."
)
Grid = Annotated[str | None, typer.Option("--grid", metavar="SPEC", help=_GRID)]
Parameters = Annotated[
    str | None, typer.Option("-p", "--parameters", metavar="PARAMS.yaml", help="Parameter values; default: nominal.")
]
Select = Annotated[
    str,
    typer.Option(
        "--select",
        metavar="NAMES",
        help="Parameters: auto, all, names, patterns, e.g. auto,R_low,-g*,drift@grid.lag.",
        autocompletion=_completion.parameters,
    ),
]
Alpha = Annotated[float, typer.Option("--alpha", help="False-alarm rate of the whole diagnosis.")]
Method = Annotated[
    str,
    choice("--method", "exact|linear|rigid", "exact, linear (the paper's one step) or rigid."),
]
Offset = Annotated[
    list[str] | None,
    typer.Option(
        "--offset",
        metavar='NAME="50 um"',
        help="Move an actuator off its set value (strained pose).",
        autocompletion=_completion.drives,
    ),
]
Json = Annotated[bool, typer.Option("--json", help="Write the result to stdout as JSON.")]
Plot = Annotated[
    str | None,
    typer.Option("--plot", metavar="FILE.svg|png|pdf", help="Picture of the result, written in addition."),
]
Quiet = Annotated[bool, typer.Option("-q", "--quiet", help="Write only errors to stderr.")]
Force = Annotated[bool, typer.Option("--force", help="Replace an existing output file.")]
RunFolder = Annotated[
    str | None, typer.Option("--run", metavar="DIR", help="Keep inputs, results and versions in a new folder of DIR.")
]
Accept = Annotated[bool, typer.Option("--accept", help="Accept an implausible result; the doubts are recorded.")]
FailOn = Annotated[
    str | None,
    typer.Option("--fail-on", metavar="LIST", help="Results that end with exit code 1; none: never."),
]
Style = Annotated[
    str,
    choice("--format", "text|github", "github: warnings and errors also as annotations of files."),
]
FailAbove = Annotated[
    list[str] | None,
    typer.Option(
        "--fail-above",
        metavar='"KIND VALUE"',
        help='Exit with 1 above a limit: "heldout 20 um", fitted, chi2, std:NAME, change; can be repeated.',
        autocompletion=_completion.limits,
    ),
]
FailAboveChange = Annotated[
    list[str] | None,
    typer.Option(
        "--fail-above",
        metavar='"KIND VALUE"',
        help='Exit with 1 above a limit: "change 20 um"; heldout, fitted, chi2, std:NAME of the last file or machine.',
        autocompletion=_completion.limits,
    ),
]
MaxRms = Annotated[
    str | None, typer.Option("--max-rms", metavar="VALUE", help="Limit of the position rms, as --fail-above.")
]
Holdout = Annotated[
    str | None,
    typer.Option("--holdout", metavar="K|session|cells|FILE.csv|none", help="Data to hold out; default: 5 folds."),
]
Dwell = Annotated[float, typer.Option("--dwell", metavar="S", help="G-code: wait at every target, seconds.")]
Feed = Annotated[float, typer.Option("--feed", metavar="F", help="G-code: feed, mm/min.")]
Loss = Annotated[
    str,
    choice("--loss", "squares|huber|tukey", "huber and tukey down-weight outliers."),
]
Prior = Annotated[
    str,
    choice("--prior", "none|ranges", "ranges: prior standard uncertainty of half a range."),
]
PriorOrFile = Annotated[
    str,
    typer.Option(
        "--prior", metavar="none|ranges|OLD.params.yaml", help="Prior knowledge: ranges, or an old calibration."
    ),
]
Loosen = Annotated[
    str | None,
    typer.Option(
        "--loosen",
        metavar="NAMES",
        help="With --prior OLD: what was repaired, e.g. l3,strut3.*.",
        autocompletion=_completion.parameters,
    ),
]
Uncertainty = Annotated[
    str,
    choice("--uncertainty", "linear|profile|bootstrap", "Method for the 95 % intervals."),
]
Starts = Annotated[
    int,
    typer.Option("--starts", min=0, max=200, help="Number of starts within the ranges; 0: one, more if it fails."),
]
Seed = Annotated[int, typer.Option("--seed", min=0, help="Seed of the bootstrap and of the starts.")]
Jobs = Annotated[
    int, typer.Option("--jobs", metavar="N", min=0, max=1024, help="Processes that share the work; 0: all cores.")
]
Cluster = Annotated[
    str | None,
    typer.Option("--cluster", metavar="tcp://HOST:PORT", help="Dask scheduler whose workers do the work."),
]
State = Annotated[
    str | None,
    typer.Option("--state", metavar="FILE.json", help="Partial results; run the same command again to resume."),
]
