"""Tasks by number: the same results whoever does them, also where a worker is killed."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest

from pkmcal_cli.base import processes
from pkmcal_cli.base.errors import BadInput, PkmcalError, UsageError
from pkmcal_cli.base.forked import POSSIBLE
from pkmcal_cli.base.processes import _Batches
from pkmcal_cli.base.stages import Observer, Stage, unobserved
from pkmcal_cli.base.workers import ALONE, Workers
from tests.command import ROOT

TWO = Workers(2)


@dataclass(frozen=True)
class Draws:
    """Sums of random matrices; `mark`: a file that says that task 7 has killed its worker once."""

    mark: str = ""

    def __call__(self, number: int, observe: Observer = unobserved) -> tuple[int, float]:
        observe(Stage("drawing"))
        if number == 7 and self.mark and not os.path.exists(self.mark):
            Path(self.mark).touch()
            os.kill(os.getpid(), signal.SIGKILL)
        drawn = np.random.default_rng(np.random.SeedSequence(3, spawn_key=(number,))).normal(size=(40, 40))
        return number, float((drawn @ drawn.T).sum())


@dataclass(frozen=True)
class Silent:
    """Tells no steps."""

    def __call__(self, number: int, observe: Observer = unobserved) -> int:
        return number


@dataclass(frozen=True)
class Refuses:
    """Finds its input bad."""

    def __call__(self, number: int, observe: Observer = unobserved) -> int:
        raise BadInput.single(f"task {number} is bad")


def test_two_processes_find_the_same_bits_though_one_is_killed(tmp_path: Path) -> None:
    mark = tmp_path / "killed"
    told: list[Stage] = []
    found = TWO.results(Draws(str(mark)), 20, "task", told.append)
    assert mark.exists() and found == ALONE.results(Draws(), 20, "task")
    assert [number for number, _ in found] == list(range(20))
    assert {(s.name, s.total) for s in told} == {("task", 20)} and told[0].done == 0


def test_where_processes_cannot_be_copied_new_ones_find_the_same_bits(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(processes, "POSSIBLE", False)
    assert TWO.results(Draws(str(tmp_path / "killed")), 20, "task") == ALONE.results(Draws(), 20, "task")
    assert (tmp_path / "killed").exists()


@dataclass(frozen=True)
class Sleeps:
    """For longer than anybody waits; task 0 is done at once. `folder`: takes the numbers of the processes."""

    folder: str

    def __call__(self, number: int, observe: Observer = unobserved) -> int:
        (Path(self.folder) / str(os.getpid())).touch()
        time.sleep(300.0 if number else 0.0)
        return number


def ended(folder: Path, patience: float = 10.0) -> bool:
    """Whether all processes that did tasks are no more, after some seconds at most."""
    until = time.monotonic() + patience
    while any(alive(int(file.name)) for file in folder.iterdir()):
        if time.monotonic() > until:
            return False
        time.sleep(0.05)
    return True


def alive(process: int) -> bool:
    """Whether a process runs: neither gone nor waiting to be missed."""
    with suppress(OSError):
        return Path(f"/proc/{process}/stat").read_text().rpartition(")")[2].split()[0] != "Z"
    return False


@pytest.mark.skipif(not POSSIBLE, reason="processes are not copied here")
def test_who_stops_asking_does_not_wait(tmp_path: Path) -> None:
    results = TWO.done(Sleeps(str(tmp_path)), range(4), "task")
    begun = time.monotonic()
    assert next(results) == {0: 0}  # type: ignore[call-overload]
    results.close()  # type: ignore[attr-defined]
    assert time.monotonic() - begun < 20.0 and ended(tmp_path)


@pytest.mark.skipif(not POSSIBLE, reason="processes are not copied here")
def test_workers_end_with_a_process_that_is_killed(tmp_path: Path) -> None:
    """It can tell them nothing, and nobody else knows of them."""
    code = f"import sys; from tests.test_workers import TWO, Sleeps; todo = Sleeps({str(tmp_path)!r})\n"
    code += "results = TWO.done(todo, range(4), 'task'); print(next(results), flush=True); sys.stdin.read()"
    program = subprocess.Popen([sys.executable, "-c", code], cwd=ROOT, stdin=subprocess.PIPE, stdout=subprocess.PIPE)
    with program:
        assert program.stdout is not None and program.stdout.readline() == b"{0: 0}\n"
        assert any(tmp_path.iterdir()) and not ended(tmp_path, 0.5)
        program.kill()
    assert ended(tmp_path)


def test_what_a_task_refuses_is_told_as_if_it_were_here() -> None:
    for workers in (ALONE, TWO):
        with pytest.raises(BadInput, match="task 0 is bad"):
            workers.results(Refuses(), 2, "task")


def test_steps_of_a_task_are_told_in_this_process() -> None:
    told: list[Stage] = []
    ALONE.results(Draws(), 2, "task", told.append)
    assert [(s.name, s.inside) for s in told if s.inside] == [("drawing", Stage("task", k, 2)) for k in range(2)]


def test_tasks_without_steps_are_told_too() -> None:
    """Whoever watches sees which task it is and how many there are, however many processes do them."""
    for workers in (ALONE, TWO):
        told: list[Stage] = []
        workers.results(Silent(), 3, "task", told.append)
        assert told[0] == Stage("task", 0, 3) and {(s.name, s.total) for s in told} == {("task", 3)}
        assert [s.done for s in told][-1] == 2


def test_batches_grow_with_quick_tasks_and_shrink_towards_the_end() -> None:
    batches, sizes = _Batches(range(1000), 2), []
    for part in batches:
        sizes.append(len(part))
        batches.learn(0.01)
    assert sizes[0] == 1 and max(sizes) > 50 and sizes[-1] == 1 and sum(sizes) == 1000
    slow = _Batches(range(10), 2)
    slow.learn(5.0)
    assert [len(part) for part in slow] == [1] * 10


def test_options_that_exclude_each_other() -> None:
    with pytest.raises(UsageError, match="exclude"):
        Workers.of(2, "tcp://127.0.0.1:1")
    assert Workers.of(0).jobs >= 1


def test_one_job_needs_no_joblib() -> None:
    code = "from pkmcal_cli.app import run; import sys;"
    code += "run(['study', 'scissors', '-q', '--points', '10', '--repeat', '2']);"
    code += "print([m for m in ('joblib', 'cloudpickle', 'distributed') if m in sys.modules])"
    done = subprocess.run([sys.executable, "-c", code], cwd=ROOT, capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"


@pytest.mark.slow
def test_a_cluster_of_two_workers_finds_the_same_bits_though_one_is_killed(tmp_path: Path) -> None:
    distributed = pytest.importorskip("distributed")
    with distributed.LocalCluster(n_workers=2, threads_per_worker=1, dashboard_address=None) as cluster:
        there = Workers(1, cluster.scheduler_address)
        expected = ALONE.results(Draws(), 60, "task")
        assert there.results(Draws(), 60, "task") == expected
        assert there.results(Draws(str(tmp_path / "killed")), 60, "task") == expected
    assert (tmp_path / "killed").exists()
    with pytest.raises(PkmcalError, match="no scheduler"):
        Workers(1, "tcp://127.0.0.1:1").results(Draws(), 2, "task")
