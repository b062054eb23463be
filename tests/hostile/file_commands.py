"""The commands whose file operations fail: what they write, what was there before, and what must not be accepted."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from pkmcal_cli.base.files import sha256
from pkmcal_cli.csv_files.origin import beside, origin_note
from tests.command import MACHINES, run

OLD = "old\n"
_GRID = "--grid x=300:500:2,y=200:300:2"
_FEW = 24  # rows of a table


@dataclass(frozen=True, kw_only=True)
class Writing:
    """A command with the files that it writes into the folder `{o}`; inputs are in `{i}`, machines in `{m}`.

    groups: names of files that appear together. before: commands that write the old files; without, they are texts.
    accepted: whether a command takes the files of a folder as belonging together. goes_on: whether the same command,
    run again, must come to the same end. rough: files whose content depends on the time it takes.
    """

    command: str
    groups: tuple[tuple[str, ...], ...] = ()
    before: tuple[str, ...] = ()
    accepted: Callable[[Path], bool] | None = None
    goes_on: bool = False
    rough: tuple[str, ...] = ()
    fast: bool = False


def _table(name: str) -> tuple[str, str]:
    return beside(name), name


def _own_table(name: str) -> Callable[[Path], bool]:
    """Whether a table is read as the one that the file beside it tells of."""

    def accepted(folder: Path) -> bool:
        path = folder / name
        return "ignored" not in origin_note(str(path), sha256(path), ())

    return accepted


def _improved(folder: Path) -> bool:
    """Whether parameters are taken for those of the improved machine."""
    return run("check", folder / "m.yaml", "-p", folder / "m.params.yaml").code in (0, 1)


def prepare(inputs: Path) -> None:
    """Inputs of the commands: a short table, two calibrations, two kept runs."""
    rows = (MACHINES / "biglide.csv").read_text(encoding="utf-8").splitlines(keepends=True)
    (inputs / "t.csv").write_text("".join(rows[: _FEW + 1]), encoding="utf-8")
    (inputs / "u.csv").write_text("".join([rows[0], *rows[_FEW + 1 : 2 * _FEW + 1]]), encoding="utf-8")
    for name in ("t", "u"):
        arguments = (inputs / f"{name}.csv", "-o", inputs / f"{name}.params.yaml", "--run", inputs / "runs")
        assert run("calibrate", MACHINES / "biglide.yaml", *arguments).code == 0
    worn = f'extends: "{MACHINES / "biglide.yaml"}"\neffects:\n  zero@q1: {{o: {{value: 5 um, range: 20 um}}}}\n'
    (inputs / "worn.yaml").write_text(worn, encoding="utf-8")


_BIGLIDE = "{m}/biglide.yaml"
_TABLE = "{m}/biglide.yaml {i}/t.csv"
COMMANDS: dict[str, Writing] = {
    "new": Writing(command="new rrr -o {o}/m.yaml", groups=(("m.yaml",),), fast=True),
    "schema": Writing(command="schema -o {o}/s.json", groups=(("s.json",),)),
    "simulate": Writing(
        command=f"simulate {_BIGLIDE} {_GRID} --noise declared --seed 1 -o {{o}}/t.csv",
        before=(f"simulate {_BIGLIDE} {_GRID} --noise declared --seed 2 -o {{o}}/t.csv",),
        groups=(_table("t.csv"),),
        accepted=_own_table("t.csv"),
        fast=True,
    ),
    "simulate --plot": Writing(
        command=f"simulate {_BIGLIDE} {_GRID} --plot {{o}}/s.svg", groups=(("s.svg",),)
    ),
    "draw": Writing(command=f"draw {_BIGLIDE} -o {{o}}/d.svg", groups=(("d.svg",),)),
    "calibrate": Writing(
        command=f"calibrate {_TABLE} --starts 1 --holdout none -o {{o}}/p.yaml --run {{o}}/runs",
        groups=(("p.yaml",), ("runs/",)),
        fast=True,
    ),
    "calibrate --plot": Writing(command=f"calibrate {_TABLE} --plot {{o}}/c.svg", groups=(("c.svg",),)),
    "diagnose --plots": Writing(
        command=f"diagnose {_TABLE} --plots {{o}}/plots",
        groups=(("plots/errors-xy.svg",), ("plots/variance.svg",)),
    ),
    "diagnose --run": Writing(command=f"diagnose {_TABLE} --run {{o}}/runs", groups=(("runs/",),)),
    "improve": Writing(
        command=f"improve {_TABLE} -o {{o}}/m.yaml --run {{o}}/runs",
        groups=(("m.yaml", "m.params.yaml"), ("runs/",)),
        before=("calibrate {i}/worn.yaml {i}/t.csv -o {o}/m.params.yaml",),
        accepted=_improved,
    ),
    "correct": Writing(
        command=f"correct {_BIGLIDE} {_GRID} -p {{i}}/t.params.yaml -o {{o}}/c.csv --run {{o}}/runs",
        before=(f"correct {_BIGLIDE} {_GRID} -p {{i}}/u.params.yaml -o {{o}}/c.csv",),
        groups=(_table("c.csv"), ("runs/",)),
        accepted=_own_table("c.csv"),
    ),
    "correct --as beckhoff": Writing(
        command=f"correct {_TABLE} -p {{i}}/t.params.yaml --as beckhoff -o {{o}}/c.csv",
        groups=(("c.q1.csv", "c.q2.csv", "c.q3.csv"),),
    ),
    "correct --as csv": Writing(
        command=f"correct {_TABLE} -p {{i}}/t.params.yaml --as csv -o {{o}}/c.csv",
        before=(f"correct {_TABLE} -p {{i}}/u.params.yaml --as csv -o {{o}}/c.csv",),
        groups=(_table("c.csv"),),
        accepted=_own_table("c.csv"),
    ),
    "plan": Writing(
        command=f"plan {_TABLE} --aim uncertainty --points 2 -o {{o}}/n.csv",
        groups=(_table("n.csv"),),
        accepted=_own_table("n.csv"),
    ),
    "plan --as checklist": Writing(command=f"plan {_TABLE} --as checklist -o {{o}}/n.txt", groups=(("n.txt",),)),
    "plan --as gcode": Writing(
        command="plan {m}/gantry.yaml --grid x=100:400:2,y=100:400:2 --as gcode -o {o}/n.nc",
        groups=(("n.nc",),),
    ),
    "report": Writing(command=f"report {_TABLE} -o {{o}}/r.html", groups=(("r.html",),)),
    "study": Writing(
        command=f"study {_BIGLIDE} --points 5,6 --repeat 2 --validation 2 --within x=300:600,y=200:300 "
        "--state {o}/state.json -o {o}/s.csv",
        groups=(_table("s.csv"),),
        accepted=_own_table("s.csv"),
        goes_on=True,
        rough=("state.json",),
    ),
    "compare": Writing(
        command="compare {i}/t.params.yaml {i}/u.params.yaml --plot {o}/c.svg", groups=(("c.svg",),)
    ),
    "observability": Writing(command=f"observability {_TABLE} --plot {{o}}/o.svg", groups=(("o.svg",),)),
    "sensitivity": Writing(
        command=f"sensitivity {_TABLE} --channel x -o {{o}}/s.csv",
        groups=(_table("s.csv"),),
        accepted=_own_table("s.csv"),
    ),
    "sensitivity --plot": Writing(command=f"sensitivity {_TABLE} --plot {{o}}/s.svg", groups=(("s.svg",),)),
}  # fmt: skip
