"""The program as a whole: cold start, identification, a million rows."""

from __future__ import annotations

import compileall
import contextlib
import io
import os
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from functools import cache
from pathlib import Path

import numpy as np

from pkmcal_cli.workflow.calibrate import run_calibration
from pkmcal_cli.workflow.calibration import CalibrationRequest

from .predictions import MACHINES
from .timing import Effort, Line, children_time, side_by_side

_SQUARE = "x=200:700:{0},y=170:380:{0}"  # mm, `--grid` of the Triglide
_SCISSORS = (str(MACHINES / "scissors.yaml"), str(MACHINES / "scissors.csv"))
_LIBRARIES = "numpy, pydantic, typer, rich.console, yaml"
_NOISE = ("--noise", "declared", "--seed", "1")
_STARTER = """
import os, subprocess, sys
process = subprocess.Popen(sys.argv[1:], stdout=subprocess.DEVNULL)
_, status, used = os.wait4(process.pid, 0)
print(os.waitstatus_to_exitcode(status), used.ru_utime + used.ru_stime, used.ru_maxrss)
"""


def _run(*arguments: str) -> None:
    subprocess.run([sys.executable, *arguments], check=True, capture_output=True, cwd=MACHINES.parent, env=_installed())


@cache
def _installed() -> dict[str, str]:
    """The environment of a program whose modules are compiled, as an installation leaves them."""
    compileall.compile_dir(MACHINES.parent / "pkmcal_cli", quiet=2)
    return {name: value for name, value in os.environ.items() if name != "PYTHONDONTWRITEBYTECODE"}


def start_lines(effort: Effort) -> list[Line]:
    """Cold start of `--help`, `check` and `calibrate` against an empty program, and against the libraries they need."""
    machine = str(MACHINES / "triglide.yaml")
    times = side_by_side(
        {
            "pass": lambda: _run("-c", "pass"),
            "libraries": lambda: _run("-c", f"import {_LIBRARIES}"),
            "help": lambda: _run("-m", "pkmcal_cli", "--help"),
            "check": lambda: _run("-m", "pkmcal_cli", "check", machine),
            "scipy": lambda: _run("-c", "import scipy.optimize"),
            "fitting": lambda: _run("-c", f"import {_LIBRARIES}, scipy.linalg, scipy.special"),
            "calibrate": lambda: _run("-m", "pkmcal_cli", "calibrate", *_SCISSORS, "-q"),
        },
        effort.rounds,
        children_time,
    )
    note = f"`python -c pass` {1e3 * times.median('pass'):.0f} ms"
    return [
        Line("`pkmcal --help` : `python -c pass`", times.ratio("help", "pass"), 5, note=note),
        Line("`pkmcal check triglide.yaml` : `python -c pass`", times.ratio("check", "pass"), 25, note=note),
        Line("`pkmcal check triglide.yaml` : its libraries alone", times.ratio("check", "libraries")),
        Line("`pkmcal calibrate` on the Scissors : `import scipy.optimize`", times.ratio("calibrate", "scipy"), 1.5),
        Line("its libraries alone : `import scipy.optimize`", times.ratio("fitting", "scipy"), note="the floor"),
    ]


_ONE_EFFECT = {"scissors": "backlash@q3", "hangprinter": "release R_low"}
"""What is looked for where times mean nothing."""


def loop_lines(effort: Effort) -> Iterator[Line]:
    """`diagnose` and `improve` as whole processes: a table of a workshop, and one of a machine of ropes."""
    limits = {"diagnose": 2.0, "improve": 10.0}
    with tempfile.TemporaryDirectory() as folder:
        for machine, table in (("scissors", "scissors-shopfloor"), ("hangprinter", "hangprinter_2021-12-16")):
            files = (str(MACHINES / f"{machine}.yaml"), str(MACHINES / f"{table}.csv"), "-q")
            targets = {"diagnose": (), "improve": ("-o", str(Path(folder) / f"{machine}.yaml"), "--force")}
            if effort.share < 1.0:
                targets["improve"] += ("--only", _ONE_EFFECT[machine])
            for command, limit in limits.items():
                rounds = range(max(effort.rounds // 3, 1))
                seconds = [command_cost(command, *files, *targets[command])[0] for _ in rounds]
                yield Line(f"`{command}` of {table}.csv", float(np.median(seconds)), limit, unit="s")


def calibration_line(effort: Effort) -> Line:
    """`calibrate` on the Scissors from files to the report, inside the process."""
    machine, measured = _SCISSORS
    request = CalibrationRequest(machine=machine, measurements=(measured,), quiet=True)

    def calibrate() -> None:
        with contextlib.redirect_stdout(io.StringIO()), contextlib.redirect_stderr(io.StringIO()):
            if run_calibration(request) != 0:
                raise RuntimeError("calibrate failed")

    times = side_by_side({"calibrate": calibrate}, effort.rounds)
    what = "`calibrate` on the Scissors, 80 points and 9 parameters, with held-out error"
    return Line(what, times.median("calibrate"), 0.3, unit="s")


def million_lines(effort: Effort) -> list[Line]:
    """`simulate` of a million rows on the Triglide, and of a quarter of them: time per row and peak memory."""
    side = effort.rows(500)
    quarter, _ = _simulate(side)
    whole, memory = _simulate(2 * side)
    what = f"`simulate` of {4 * side**2} rows on the Triglide"
    return [
        Line(f"{what}: time per row, against {side**2} rows", whole / quarter / 4, 1.2, note=f"{whole:.0f} s in total"),
        Line(f"{what}: peak memory", memory, 1024, unit="MiB"),
    ]


def memory_lines(effort: Effort) -> Iterator[Line]:
    """Peak memory of `calibrate` on the Triglide: of a million rows, and by how much the bootstrap is above the fit."""
    machine = str(MACHINES / "triglide.yaml")
    with tempfile.TemporaryDirectory() as folder:
        whole, part = (_table(folder, effort.rows(side)) for side in (1000, 316))
        seconds, peak = command_cost("calibrate", machine, whole, "-q")
        what = f"`calibrate` of {effort.rows(1000) ** 2} rows on the Triglide, with held-out error: peak memory"
        yield Line(what, peak, 1024, unit="MiB", note=f"{seconds:.0f} s in total")
        plain = ("calibrate", machine, part, "-q", "--holdout", "none")
        _, fit = command_cost(*plain)
        _, bootstrap = command_cost(*plain, "--uncertainty", "bootstrap")
        what = f"bootstrap of {effort.rows(316) ** 2} rows on the Triglide: memory above the peak of the fit"
        yield Line(what, max(bootstrap - fit, 0.0), 200, unit="MiB", note=f"fit {fit:.0f} MiB")


def _table(folder: str, side: int) -> str:
    """A table with noise of a grid of `side` by `side` positions of the Triglide."""
    target = str(Path(folder) / f"{side}.csv")
    _on_grid(side, target, *_NOISE, "--force")  # in the shortest run both tables are of one size
    return target


def _simulate(side: int) -> tuple[float, float]:
    """Processor time, s, and peak memory, MiB, of a grid of `side` by `side` positions."""
    with tempfile.TemporaryDirectory() as folder:
        return _on_grid(side, str(Path(folder) / "out.csv"))


def _on_grid(side: int, target: str, *options: str) -> tuple[float, float]:
    where = ("--grid", _SQUARE.format(side), "-o", target)
    return command_cost("simulate", str(MACHINES / "triglide.yaml"), "-q", *where, *options)


def command_cost(*arguments: str) -> tuple[float, float]:
    """Processor time, s, and peak memory, MiB, of a command.

    It is started by a small process: the peak of a program counts that of the process that it was forked from.
    """
    command = [sys.executable, "-m", "pkmcal_cli", *arguments]
    started = [sys.executable, "-c", _STARTER, *command]
    ended = subprocess.run(started, check=True, capture_output=True, text=True, cwd=MACHINES.parent, env=_installed())
    code, seconds, kibibytes = ended.stdout.split()
    if int(code) not in (0, 1):
        raise RuntimeError(f"{arguments[0]} failed: {ended.stderr}")
    return float(seconds), float(kibibytes) / 1024
