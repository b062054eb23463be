"""One simulated campaign as the engine sees it, before anything is planted: hypotheses and the linearised problem."""

from __future__ import annotations

import tempfile
from dataclasses import dataclass
from functools import cache, cached_property
from pathlib import Path

import numpy as np

from pkmcal_cli.base.rotation import Array
from pkmcal_cli.calibration.measured_problem import problem_of
from pkmcal_cli.calibration.problem import Problem
from pkmcal_cli.calibration.selection import select
from pkmcal_cli.compiler import compile_machine
from pkmcal_cli.diagnosis.hypotheses import RELEASE, Candidates, Hypothesis, candidates
from pkmcal_cli.diagnosis.linear import Linear, linear_problem
from pkmcal_cli.diagnosis.run_diagnosis import Diagnosis, diagnose
from pkmcal_cli.diagnosis.score import NONCENTRALITY, Score
from pkmcal_cli.language.machine import Machine
from pkmcal_cli.language.machine_yaml import read_machine
from pkmcal_cli.model.model import Model
from pkmcal_cli.tables.measurements import read_measurements
from tests.truth.campaigns import Campaign, Planted, Scenario, campaign

FOLDER = Path(__file__).parent / "machines"
ALPHA = 0.005
SAME = 0.99999  # cosine at which an effect is another name for a parameter that is held


@cache
def machine(name: str) -> tuple[Machine, Model]:
    """A machine with the pitch of its screws, and its model that takes effects."""
    described = read_machine(FOLDER / f"{name}.yaml")
    return described, compile_machine(described, True).model


@dataclass(frozen=True)
class Ready:
    """A campaign as the engine gets it."""

    candidates: Candidates
    problem: Problem
    selected: tuple[str, ...]


def ready(measured: Campaign) -> Ready:
    """The campaign's table, read as a user's."""
    described, model = machine(measured.machine)
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "table.csv"
        file.write_text(measured.csv_text(), encoding="utf-8")
        table = read_measurements([file], described)
    selected = select(model, "auto")
    found = candidates(model, selected, table)
    return Ready(found, problem_of(found.model, table), selected)


def diagnosed(measured: Campaign, seed: int) -> Diagnosis:
    """The diagnosis of a campaign at the usual rate of false alarms."""
    case = ready(measured)
    return diagnose(case.candidates, case.problem, case.selected, ALPHA, seed)


@dataclass(frozen=True)
class Setting:
    """A campaign with nothing planted; sizes and angles of effects are computed here, from the truth's readings."""

    plain: Campaign
    values: Array | None = None  # parameters (P,) at which all is linearised, else the true ones

    @classmethod
    def of(cls, name: str, seed: int, scenario: Scenario | None = None) -> Setting:
        """The campaign of a machine and a seed."""
        return cls(campaign(name, [], seed, scenario=scenario))

    @cached_property
    def ready(self) -> Ready:
        """The same as the engine gets it."""
        return ready(self.plain)

    @cached_property
    def linear(self) -> Linear:
        """All hypotheses at these parameters."""
        values = self._true if self.values is None else self.values
        names = (n for h in self.ready.candidates.hypotheses for n in h.parameters)
        every = [n for n in dict.fromkeys(names) if n not in self.ready.selected]
        return linear_problem(self.ready.problem, values, self.ready.selected, every, None)

    @property
    def _true(self) -> Array:
        model = self.ready.candidates.model
        values = model.nominal.copy()
        for name, value in self.plain.parameters.items():
            values[model.names.index(name)] = value
        return values

    @cached_property
    def scores(self) -> dict[str, tuple[Hypothesis, Score]]:
        """Every hypothesis and which of its directions can be seen, by name."""
        return {h.name: (h, self.linear.score(self.linear.of(h.parameters))) for h in self.ready.candidates.hypotheses}

    def change(self, planted: Planted) -> Array:
        """What an effect does to the readings (N * C,), in stated standard deviations."""
        c = self.plain
        with_it = campaign(c.machine, [planted], c.noise_seed[0], scenario=c.scenario).true_readings
        return np.asarray(((with_it - c.true_readings) / c.sigma).ravel())

    def size(self, change: Array, others: list[Array] | None = None) -> float:
        """Size in minimal detectable ones, declared parameters and the changes by other effects projected out."""
        linear = self.linear
        if others:
            linear = linear.projecting(linear.projected, extra=np.stack(others, axis=1))
        return float(np.sqrt(max(float(change @ linear.free(change)), 0.0) / NONCENTRALITY))

    @staticmethod
    def size_raw(change: Array) -> float:
        """The same with nothing projected out."""
        return float(np.sqrt(change @ change / NONCENTRALITY))

    def basis(self, name: str) -> Array:
        """Orthonormal columns that a hypothesis spans after projection."""
        hypothesis, score = self.scores[name]
        free = self.linear.free(self.linear.of(hypothesis.parameters) @ score.basis)
        return np.asarray(free / np.sqrt(score.information))

    def cosine(self, change: Array, name: str) -> float:
        """Cosine between a change and what a hypothesis can explain, after projection."""
        if not self.scores[name][1].count:
            return 0.0
        length = float(np.sqrt(change @ self.linear.free(change)))
        explained = self.basis(name).T @ change
        return float(np.sqrt(explained @ explained)) / length

    def _explained(self, change: Array, name: str) -> Array:
        """What a hypothesis makes of a change."""
        hypothesis, score = self.scores[name]
        unit = self.linear.of(hypothesis.parameters) @ score.basis / np.sqrt(score.information)
        return np.asarray(unit @ (self.basis(name).T @ change))

    def rival(self, change: Array, name: str) -> tuple[str, float]:
        """The other hypothesis with the largest cosine, with the change or with that part of it which the effect's own
        hypothesis explains; not a held parameter of which the effect is another name, nor the sum of several places."""
        mine = self.basis(name)
        own = self._explained(change, name)
        best = ("", 0.0)
        for other, (hypothesis, score) in self.scores.items():
            if other == name or not score.count or hypothesis.members:
                continue
            cosine = max(self.cosine(change, other), self.cosine(own, other))
            alias = hypothesis.effect == RELEASE and mine.shape[1] == 1
            if alias and abs(float((mine.T @ self.basis(other))[0, 0])) > SAME:
                continue
            if cosine > best[1]:
                best = (other, cosine)
        return best
