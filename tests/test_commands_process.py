"""Commands as processes: pipes, closed streams, signals, colours, cold start."""

from __future__ import annotations

import contextlib
import json
import os
import pty
import re
import signal
import subprocess
import sys
import time
from collections.abc import Sequence
from pathlib import Path

import pytest

from tests.command import GRID, ROOT, SCISSORS, SHOPFLOOR, TRIGLIDE, TRIGLIDE_DATA, Done, environment, process, run
from tests.in_ci import in_ci

PROGRAM = [sys.executable, "-m", "pkmcal_cli"]
COMMAND = " ".join(PROGRAM)
# The program with a bar for work of any length: how long a work takes is the machine's business.
AT_ONCE = [
    sys.executable, "-c",
    "from pkmcal_cli.report import progress_bar; progress_bar._AFTER = 0.0; from pkmcal_cli.app import main; main()",
]  # fmt: skip


def _name(kind: signal.Signals) -> str:
    return kind.name


def shell(line: str, cwd: Path = ROOT) -> Done:
    """A line of bash."""
    done = subprocess.run(["bash", "-c", line], cwd=cwd, env=environment(), capture_output=True, text=True, check=False)
    return Done(done.returncode, done.stdout, done.stderr)


def python(code: str, **more: str) -> Done:
    """A program of a few lines."""
    run = [sys.executable, "-c", code]
    done = subprocess.run(run, cwd=ROOT, env=environment(**more), capture_output=True, text=True, check=False)
    return Done(done.returncode, done.stdout, done.stderr)


def test_simulate_pipes_into_calibrate(tmp_path: Path) -> None:
    made = run("simulate", TRIGLIDE, "--grid", GRID, "--noise", "declared")
    assert made.code == 0 and "rows simulated" in made.err and "rows simulated" not in made.out
    done = process("calibrate", TRIGLIDE, "-", "-o", tmp_path / "p.yaml", "--json", stdin=made.out)
    assert done.code == 0 and json.loads(done.out)["n_rows"] == 12
    text = (tmp_path / "p.yaml").read_text()
    assert "<stdin>: " in text, "stdin is among the inputs, with its sha256"


@pytest.mark.slow
def test_a_real_pipe(tmp_path: Path) -> None:
    (tmp_path / "poses.csv").write_text("x,y\n" + "".join(f"{x},{y}\n" for x in (200, 400, 600) for y in (200, 300)))
    simulate = f"{COMMAND} simulate {TRIGLIDE} - -q <poses.csv"
    done = shell(f"{simulate} | {COMMAND} calibrate {TRIGLIDE} - -o p.yaml -q", tmp_path)
    assert (done.code, done.out, done.err) == (0, "", "")
    assert "status: converged" in (tmp_path / "p.yaml").read_text()


def test_machines_and_parameters_come_from_pipes_too() -> None:
    machine = Path(TRIGLIDE).read_text()
    assert process("check", "-", "-q", stdin=machine).code == 0
    wrong = run("check", "-", "-q", stdin=machine.replace("spaec", "space").replace("space:", "spaec:"))
    assert wrong.code == 1 and wrong.err.startswith("<stdin>:")
    twice = run("simulate", "-", "-", stdin=machine)
    assert twice.code == 2 and "only one input can be `-`" in twice.err
    values = run("simulate", TRIGLIDE, "--grid", GRID, "-p", "-", "-q", stdin="parameters: {l1: 301}")
    assert values.code == 0


def test_nobody_is_asked_anything() -> None:
    """With an empty stdin, or none at all, every command ends."""
    assert run("calibrate", TRIGLIDE, "-", stdin="").code == 3
    done = subprocess.run(
        [*PROGRAM, "calibrate", TRIGLIDE, "-"], stdin=subprocess.DEVNULL, capture_output=True, text=True, cwd=ROOT,
        env=environment(), timeout=60, check=False,
    )  # fmt: skip
    assert done.returncode == 3 and "this file contains no table" in done.stderr


def test_a_reader_that_leaves_is_no_traceback() -> None:
    """`simulate | head -1`: the output could not be written (4), and nothing more is said."""
    simulate = f'{COMMAND} simulate {TRIGLIDE} --grid "x=200:700:300,y=200:350:300" -q'
    done = shell(f"{simulate} | head -1; exit ${{PIPESTATUS[0]}}")
    assert (done.code, done.err) == (4, "")
    assert done.out.startswith("# simulated: no measurements")


@pytest.mark.parametrize("arguments", ["--help", f"check {TRIGLIDE} -q --json", "schema", "--version"])
def test_a_closed_or_full_stdout_is_an_output_error(arguments: str) -> None:
    for where in (">&-", ">/dev/full"):
        done = shell(f"{COMMAND} {arguments} {where}")
        assert done.code == 4, (where, done.err)
        assert "error[output]: cannot be written" in done.err
        assert "Traceback" not in done.err and "Exception ignored" not in done.err


def test_a_closed_stderr_does_not_stop_the_work() -> None:
    for where in ("2>&-", "2>/dev/full"):
        done = shell(f"{COMMAND} check {TRIGLIDE} --json {where}")
        assert done.code == 0 and json.loads(done.out)["ok"], where
        failing = shell(f"{COMMAND} check nope.yaml {where}")
        assert (failing.code, failing.out) == (3, ""), where


@pytest.mark.parametrize("kind", in_ci(["SIGINT", "SIGHUP"], [signal.SIGINT, signal.SIGTERM, signal.SIGHUP], _name))
def test_ctrl_c_ends_with_130_and_leaves_no_file(kind: signal.Signals, tmp_path: Path) -> None:
    out = tmp_path / "out.csv"
    arguments = ["simulate", TRIGLIDE, "--grid", "x=200:700:3000,y=200:350:3000", "-o", str(out)]
    running = subprocess.Popen(
        [*PROGRAM, *arguments], cwd=ROOT, env=environment(), stderr=subprocess.PIPE, text=True,
        preexec_fn=lambda: signal.signal(kind, signal.SIG_DFL),  # what runs in the background ignores some
    )  # fmt: skip
    for _ in range(600):
        if list(tmp_path.glob(".out.csv.*.part")):
            break
        time.sleep(0.05)
    time.sleep(0.2)
    running.send_signal(kind)
    _, said = running.communicate(timeout=60)
    assert running.returncode == 130 and said.strip() == "stopped"
    assert list(tmp_path.iterdir()) == []


def test_a_signal_that_an_import_wraps_stops_as_well() -> None:
    """Python 3.11 makes a RuntimeError of what is raised while a class is made."""
    code = (
        "import dataclasses, os, signal, sys\nfrom pkmcal_cli import app\nmake = dataclasses.Field.__set_name__\n"
        "def name(self, owner, name):\n    if owner.__name__ == 'FaultList': os.kill(os.getpid(), signal.SIGTERM)\n"
        "    return make(self, owner, name)\n"
        f"dataclasses.Field.__set_name__ = name\nsys.argv = ['pkmcal', 'check', {TRIGLIDE!r}]\napp.main()\n"
    )
    done = python(code)
    assert (done.code, done.out, done.err) == (130, "", "stopped\n")


def _on_a_terminal(*arguments: str, program: Sequence[str] = PROGRAM, **more: str) -> str:
    """What a command writes to stderr where that is a terminal."""
    ours, theirs = pty.openpty()
    env = environment(TERM="xterm-256color", COLUMNS="120", **more)
    command = [*program, *arguments]
    with subprocess.Popen(command, stderr=theirs, stdout=subprocess.DEVNULL, cwd=ROOT, env=env) as running:
        os.close(theirs)
        parts = []
        while True:
            try:
                part = os.read(ours, 65536)
            except OSError:
                break
            if not part:
                break
            parts.append(part)
        running.wait()
    os.close(ours)
    return b"".join(parts).decode()


def test_colours_only_on_a_terminal_and_not_with_no_color() -> None:
    assert "\x1b[" in _on_a_terminal("check", TRIGLIDE)
    plain = _on_a_terminal("check", TRIGLIDE, NO_COLOR="1")
    assert not re.search(r"\x1b\[(3|9)\d", plain), "no colour, though bold and italics may stay"
    assert "\x1b" not in process("check", TRIGLIDE).err


def test_progress_only_on_a_terminal(tmp_path: Path) -> None:
    """The line is taken away before the result, and `-q` needs none."""
    arguments = ("simulate", TRIGLIDE, "--grid", "x=200:700:80,y=200:350:50")
    shown = _on_a_terminal(*arguments, program=AT_ONCE)
    assert "row " in shown and " of 4000" in shown and "4000 rows simulated" in shown
    assert shown.count("\x1b[?25l") == shown.count("\x1b[?25h") == 1, "the cursor is hidden, and shown again"
    assert "\x1b[2K" in shown.partition("\x1b[?25h")[2].partition("4000 rows")[0], "erased before the result"
    assert _on_a_terminal(*arguments, "-q", program=AT_ONCE) == ""
    piped = subprocess.run(
        [*AT_ONCE, *arguments], cwd=ROOT, env=environment(FORCE_COLOR="1"), capture_output=True, text=True, check=True
    ).stderr
    assert "4000 rows simulated" in piped and " of 4000" not in piped and "\x1b[?25" not in piped
    file = tmp_path / "many.csv"
    file.write_text("x,y\n" + "".join(f"{300 + k % 100},{250 + k % 50}\n" for k in range(4000)))
    written = ("simulate", TRIGLIDE, str(file), "-o", str(tmp_path / "out.csv"))
    assert re.search(r"row \d+ of [34]\d{3} ", _on_a_terminal(*written, program=AT_ONCE)), "of a file by its size"


@pytest.mark.slow
def test_a_search_that_is_stopped_leaves_a_clean_terminal() -> None:
    ours, theirs = pty.openpty()
    with subprocess.Popen(
        [*PROGRAM, "improve", SCISSORS, SHOPFLOOR], stderr=theirs, stdout=subprocess.DEVNULL, cwd=ROOT,
        env=environment(TERM="xterm-256color", COLUMNS="120"),
        preexec_fn=lambda: signal.signal(signal.SIGINT, signal.default_int_handler),
    ) as running:  # fmt: skip
        os.close(theirs)
        shown = os.read(ours, 65536)
        while b"search" not in shown:
            shown += os.read(ours, 65536)
        running.send_signal(signal.SIGINT)
        with contextlib.suppress(OSError):
            while part := os.read(ours, 65536):
                shown += part
    os.close(ours)
    assert running.returncode == 130 and shown.count(b"\x1b[?25h") == 1
    assert shown.decode().rstrip().endswith("stopped") and b"Traceback" not in shown
    assert b"search" not in shown.partition(b"\x1b[?25h")[2], "nothing of the line is left"


def test_output_is_utf_8_whatever_the_locale() -> None:
    done = subprocess.run(
        [*PROGRAM, "sensitivity", TRIGLIDE, "--json"], cwd=ROOT, capture_output=True, check=True,
        env=environment(LC_ALL="C", PYTHONIOENCODING="ascii", PYTHONUTF8="0"),
    )  # fmt: skip
    json.loads(done.stdout.decode())
    assert "\u2588" in done.stderr.decode()


def test_an_unforeseen_error_is_70_and_the_trace_comes_on_request() -> None:
    code = (
        "import sys\nfrom pkmcal_cli import app\nimport pkmcal_cli.workflow.check as c\n"
        "def fail(*a): raise ZeroDivisionError('boom')\nc.run_check = fail\n"
        f"sys.argv = ['pkmcal', 'check', {TRIGLIDE!r}]\napp.main()\n"
    )
    done = python(code)
    assert done.code == 70 and "Traceback" not in done.err
    assert "internal error: ZeroDivisionError: boom" in done.err and "run again with PKMCAL_DEBUG=1" in done.err
    assert "Traceback" in python(code, PKMCAL_DEBUG="1").err


def test_the_trace_of_a_foreseen_error_comes_on_request_too() -> None:
    """Where is this message made? The exit code stays."""
    code = "import sys\nfrom pkmcal_cli import app\nsys.argv = ['pkmcal', 'check', 'none.yaml']\napp.main()\n"
    plain, traced = python(code), python(code, PKMCAL_DEBUG="1")
    assert plain.code == traced.code == 3 and "Traceback" not in plain.err
    assert "Traceback" in traced.err and traced.err.endswith(plain.err)


def test_too_little_memory_is_told(monkeypatch: pytest.MonkeyPatch) -> None:
    def full(*_: object) -> int:
        raise MemoryError

    monkeypatch.setattr("pkmcal_cli.workflow.check.run_check", full)
    done = run("check", TRIGLIDE)
    assert done.code == 3 and "not enough memory" in done.err


def imported(*arguments: str, of: tuple[str, ...]) -> str:
    """Which of some modules a command imports."""
    code = f"import sys; from pkmcal_cli import app; app.run({[*arguments, '-q']!r});"
    return python(code + f"print([m for m in {of!r} if m in sys.modules])").out.strip()


LIBRARIES = {"typer", "shellingham", "annotated_doc"}
READER_LIBRARIES = {"numpy", "pydantic", "pydantic_core", "annotated_types", "typing_inspection", "yaml", "rich"}


@pytest.mark.parametrize(
    ("arguments", "libraries"),
    [
        (("--help",), LIBRARIES),
        # a machine that is not redundant: of others, `check` looks at poses, which is no start
        (("check", str(ROOT / "machines" / "triglide-nonredundant.yaml"), "-q"), LIBRARIES | READER_LIBRARIES),
    ],
)
def test_a_cold_start_loads_only_what_it_uses(arguments: tuple[str, ...], libraries: set[str]) -> None:
    """Which libraries and how many modules are loaded decides how fast a command starts (benchmarks/program.py)."""
    code = f"""
import sys
before = set(sys.modules)
from pkmcal_cli import app
app.run({[*arguments]!r})
loaded = set(sys.modules) - before
print(*sorted({{name.split(".")[0] for name in loaded}} - set(sys.stdlib_module_names) - {{"typing_extensions"}}))
print(*sorted(name for name in loaded if name.startswith("pkmcal_cli")))
"""
    names, modules = (line.split() for line in python(code).out.splitlines()[-2:])
    here = {name for name in names if not name.startswith(("_", "cython"))}  # cython: inside compiled libraries
    assert here - {"pkmcal_cli"} <= libraries
    rooms = {name.split(".")[1] for name in modules if "." in name}
    assert not rooms & {"diagnosis", "correction", "tables", "csv_files", "sheet", "pictures"}
    assert len(modules) <= (30 if arguments == ("--help",) else 215), len(modules)


@pytest.mark.parametrize(
    "arguments",
    [("calibrate", TRIGLIDE, TRIGLIDE_DATA), pytest.param(("observability", TRIGLIDE), marks=pytest.mark.slow)],
)
def test_no_command_needs_scipys_statistics_or_optimisers(arguments: tuple[str, ...]) -> None:
    assert imported(*arguments, of=("scipy.stats", "scipy.optimize", "pandas")) == "[]"
