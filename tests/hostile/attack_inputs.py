"""Attacks: which text stands in which place of which input, and which command reads it."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from functools import cache
from itertools import count

from tests.command import MACHINES, run
from tests.hostile.attack_texts import BOMBS, CODE, NAMES, TAGS

_ROWS = 15


@dataclass(frozen=True)
class Attack:
    """A place in words, the command, and files that differ from the usual ones."""

    place: str
    words: tuple[str, ...]
    files: Mapping[str, str] = field(default_factory=dict)


@cache
def base_files() -> Mapping[str, str]:
    """The usual inputs: machine, overlay, table, parameters, printer."""
    machine = (MACHINES / "biglide.yaml").read_text(encoding="utf-8")
    rows = (MACHINES / "biglide.csv").read_text(encoding="utf-8").splitlines()[: _ROWS + 1]
    done = run("calibrate", MACHINES / "biglide.yaml", MACHINES / "biglide.csv", "-o", "-")
    parameters = done.out.replace(str(MACHINES / "biglide.yaml"), "gone.yaml")  # `compare` predicts nothing then
    printer = (MACHINES / "printer.cfg").read_text(encoding="utf-8")
    effects = "extends: m.yaml\neffects:\n  zero@q1: {o: {value: 5 um, range: 20 um}}\n"
    return {"m.yaml": machine, "t.csv": "\n".join(rows) + "\n", "p.yaml": parameters, "q.yaml": parameters,
            "printer.cfg": printer, "e.yaml": effects}  # fmt: skip


_M, _T, _P = "{i}/m.yaml", "{i}/t.csv", "{i}/p.yaml"
_BOX = "x=300:600,y=200:300"
MACHINE_COMMANDS = (
    f"check {_M}", f"simulate {_M} {_T} -o {{o}}/s.csv", f"draw {_M} -o {{o}}/d.svg", f"sensitivity {_M} --json",
    f"observability {_M} {_T}", f"plan {_M} {_T} --points 1 -o {{o}}/n.csv", f"calibrate {_M} {_T} -o {{o}}/c.yaml",
    f"effects {_M}", f"correct {_M} {_T} --as beckhoff -o {{o}}/b.csv", f"improve {_M} {_T} -o {{o}}/i.yaml",
    f"study {_M} --points 5 --repeat 2 --validation 1 --within {_BOX} -o {{o}}/s.csv", f"compare {_M} {_M} --json",
    f"diagnose {_M} {_T} --json", f"report {_M} {_T} -o {{o}}/r.html",
)  # fmt: skip
TABLE_COMMANDS = (
    f"check {_M} {_T} --json", f"simulate {_M} {_T} -o {{o}}/s.csv", f"draw {_M} {_T} -o {{o}}/d.svg",
    f"correct {_M} {_T} -p {_P} --as csv -o {{o}}/c.csv", f"correct {_M} {_T} -p {_P} --as linuxcnc -o {{o}}/c.comp",
    f"correct {_M} {_T} -p {_P} --as gcode-drives -o {{o}}/c.nc", f"correct {_M} {_T} -p {_P} -o {{o}}/c.csv",
    f"sensitivity {_M} {_T} --channel x -o {{o}}/s.csv", f"check {_M} {_T} --format github",
    f"observability {_M} {_T} --json", f"correct {_M} {_T} -p {_P} --as beckhoff -o {{o}}/c.csv",
    f"plan {_M} {_T} --points 1 --as gcode-drives -o {{o}}/n.nc", f"calibrate {_M} {_T} -o {{o}}/c.yaml",
)  # fmt: skip
PARAMETER_COMMANDS = (
    f"check {_M} -p {_P}", f"simulate {_M} {_T} -p {_P} -o {{o}}/s.csv", f"compare {_P} {{i}}/q.yaml --json",
    f"correct {_M} {_T} -p {_P} -o {{o}}/c.csv", f"draw {_M} -p {_P} -o {{o}}/d.svg", f"check {_M} {_T} -p {_P} --json",
    f"sensitivity {_M} -p {_P}", f"correct {_M} {_T} -p {_P} --as adjust -o {{o}}/c.txt",
)  # fmt: skip
_OPTIONS = (
    f"calibrate {_M} {_T} --select", f"calibrate {_M} {_T} --fail-above", f"calibrate {_M} {_T} --holdout",
    f"calibrate {_M} {_T} --prior", f"sensitivity {_M} --offset", f"sensitivity {_M} --size",
    f"sensitivity {_M} --channel", f"simulate {_M} --grid", f"simulate {_M} {_T} --noise", f"correct {_M} {_T} --at",
    f"correct {_M} {_T} --as", f"check {_M} {_T} -p {_P} --tolerance", f"study {_M} --points 5 --within",
    f"study {_M} --points", f"improve {_M} {_T} --only", f"diagnose {_M} {_T} --fail-on", "new", "new rrr --span",
    "new --from", f"plan {_M} {_T} --aim", f"compare {_P} {_P} --machine", f"draw {_M} --scale", "check", "effects",
)  # fmt: skip
_NAMED = (
    f"simulate {_M} {_T} -o {{o}}/", f"draw {_M} --force -o {{o}}/d.svg/../", f"calibrate {_M} {_T} --run {{o}}/",
    f"calibrate {_M} {_T} -o {{o}}/", "new rrr -o {o}/", "schema -o {o}/",
    f"correct {_M} {_T} -p {_P} --as beckhoff -o {{o}}/", f"correct {_M} {_T} -p {_P} --as csv -o {{o}}/",
)  # fmt: skip


def _quoted(text: str) -> str:
    """As YAML."""
    return json.dumps(text)


def _machine(old: str, new: str) -> Callable[[str], dict[str, str]]:
    def made(text: str) -> dict[str, str]:
        whole = base_files()["m.yaml"]
        assert whole.count(old) == 1, old
        return {"m.yaml": whole.replace(old, new.replace("@@", text))}

    return made


def _table(column: str, cell: str, before: str = "") -> Callable[[str], dict[str, str]]:
    """A column more, its name with the text in it, or its cells; lines before the header."""

    def made(text: str) -> dict[str, str]:
        header, *rows = base_files()["t.csv"].splitlines()
        cells = [_cell(c.replace("@@", text)) for c in (column, *[cell] * len(rows))]
        head = [before.replace("@@", text.replace("\n", " "))] if before else []
        lines = [f"{line},{c}" for line, c in zip((header, *rows), cells, strict=True)]
        return {"t.csv": "\n".join([*head, *lines]) + "\n"}

    return made


def _cell(text: str) -> str:
    return '"' + text.replace('"', '""') + '"' if any(c in text for c in ',"\n;') else text


def _id_cells(text: str) -> dict[str, str]:
    header, *rows = base_files()["t.csv"].splitlines()
    lines = [f"{_cell(text)}{line[line.index(',') :]}" for line in rows]
    return {"t.csv": "\n".join([header, *lines]) + "\n"}


def _number_cells(text: str) -> dict[str, str]:
    header, row, *rows = base_files()["t.csv"].splitlines()
    cells = row.split(",")
    cells[2] = _cell(text)
    return {"t.csv": "\n".join([header, ",".join(cells), *rows]) + "\n"}


def _parameters(old: str, new: str) -> Callable[[str], dict[str, str]]:
    def made(text: str) -> dict[str, str]:
        whole = base_files()["p.yaml"]
        assert old in whole, old
        return {"p.yaml": whole.replace(old, new.replace("@@", text), 1)}

    return made


PLACES: dict[str, tuple[Callable[[str], dict[str, str]], tuple[str, ...], bool]] = {
    "value of a parameter": (_machine("l1: 300", "l1: @@"), MACHINE_COMMANDS, True),
    "coordinate": (_machine("[x8, y8]", "[@@, y8]"), MACHINE_COMMANDS, True),
    "length of a bar": (_machine("length: l1", "length: @@"), MACHINE_COMMANDS, True),
    "name of a parameter": (_machine("  l2: 300", "  l2: 300\n  @@: 3"), MACHINE_COMMANDS, True),
    "unit of a parameter": (_machine("k1: {nominal: 50000, unit: N/mm", "k1: {nominal: 50000, unit: @@"),
                            MACHINE_COMMANDS, True),
    "name of a sensor": (_machine("  tracker:", "  @@:"), MACHINE_COMMANDS, True),
    "kind of a sensor": (_machine("kind: tcp", "kind: @@"), MACHINE_COMMANDS, True),
    "sigma": (_machine("sigma: 10 um", "sigma: @@"), MACHINE_COMMANDS, True),
    "extends": (_machine("space: planar", "extends: @@"), MACHINE_COMMANDS, True),
    "key of a machine file": (_machine("space: planar", "space: planar\n@@: 1"), MACHINE_COMMANDS, True),
    "cell of a drive": (_number_cells, TABLE_COMMANDS, False),
    "id": (_id_cells, TABLE_COMMANDS, False),
    "session": (_table("session", "@@"), TABLE_COMMANDS, False),
    "unknown column": (_table("@@", "1"), TABLE_COMMANDS, False),
    "unit of a column": (_table("T [@@]", "20"), TABLE_COMMANDS, False),
    "temperature": (_table("T [degC]", "@@"), TABLE_COMMANDS, False),
    "comment": (_table("note", "x", before="# @@"), TABLE_COMMANDS, False),
    "value in a parameter file": (_parameters("  l1: {value: ", "  l1: {value: @@, note: "), PARAMETER_COMMANDS, True),
    "name in a parameter file": (_parameters("parameters:\n", "parameters:\n  @@: 1\n"), PARAMETER_COMMANDS, True),
    "status of a fit": (_parameters("status: ", "status: @@ #"), PARAMETER_COMMANDS, True),
    "accepted fit": (_parameters("  created:", "  accepted: [@@]\n  created:"), PARAMETER_COMMANDS, True),
    "fingerprint": (_parameters("fingerprint: ", "fingerprint: @@ #"), PARAMETER_COMMANDS, True),
    "correlations": (_parameters("  names: [", "  names: [@@, "), PARAMETER_COMMANDS, True),
}  # fmt: skip
"""Places: what makes the files, which commands read them, whether it is YAML."""


def attacks(*, warm: bool = False) -> Iterator[Attack]:
    """All attacks, always the same ones; `warm`: harmless ones, after which libraries have their caches."""
    if warm:
        yield from (Attack("none", tuple(command.split())) for command in (f"draw {_M} -o {{o}}/d.svg", "new rrr"))
        return
    turn = count()
    for place, (made, commands, is_yaml) in PLACES.items():
        for text in (*map(_quoted, CODE), *TAGS) if is_yaml else CODE:
            command = commands[next(turn) % len(commands)]
            yield Attack(place, tuple(command.split()), made(text))
    for name, text in BOMBS.items():
        yield Attack(f"bomb of {name}", tuple(f"check {_M}".split()), {"m.yaml": text})
        yield Attack(f"bomb of {name}", tuple(f"check {{m}}/biglide.yaml -p {_P}".split()), {"p.yaml": text})
    for option in _OPTIONS:
        yield from (Attack("option", (*option.split(), text)) for text in CODE)
    yield from _file_names()
    yield from _other_files()


def _file_names() -> Iterator[Attack]:
    files = base_files()
    for number, name in enumerate(NAMES):
        for command in (MACHINE_COMMANDS[number % 9], MACHINE_COMMANDS[(number + 4) % 9]):
            words = command.replace("m.yaml", "@m").replace("t.csv", "@t").split()
            renamed = tuple(w.replace("@m", f"{name}.yaml").replace("@t", f"{name}.csv") for w in words)
            yield Attack("name of an input", renamed, {f"{name}.yaml": files["m.yaml"], f"{name}.csv": files["t.csv"]})
        for command in _NAMED:
            yield Attack("name of a result", (*command.split()[:-1], command.split()[-1] + name))


def _record(text: str) -> str:
    """Of a calibration whose inputs are elsewhere."""
    inputs = "\n".join(f"  {n}: {{file: {text}, sha256: {'0' * 64}}}" for n in ("m.yaml", "t.csv"))
    asked = "asked: {measurements: [t.csv], parameters: null, select: auto, loss: squares, prior: none, seed: 0}"
    return f"command: calibrate\nmachine: m.yaml\n{asked}\nexit_code: 0\ninputs:\n{inputs}\nresults: {{}}\n"


def _other_files() -> Iterator[Attack]:
    """States, records of runs, files beside tables, printers, overlays."""
    printer, overlay, quoted = base_files()["printer.cfg"], base_files()["e.yaml"], [*map(_quoted, CODE)]
    study = f"study {_M} --points 5 --repeat 2 --validation 1 --within {_BOX} --state {{i}}/state.json"
    for text in quoted:
        state = f'{{"form": {text}, "asked": {{"command": {text}}}, "results": {{{text}: {text}}}}}'
        yield Attack("state", tuple(study.split()), {"state.json": state})
        record = f"command: {text}\nmachine: {text}\nresults: {{{text}: {text}}}\ncreated: {text}\n"
        yield Attack("record of a run", ("compare", "{i}/runs"), {"runs/a/run.yaml": record})
        report = ("report", "{i}/runs/a", "-o", "{o}/r.html")
        yield Attack("record of a run", report, {"runs/a/run.yaml": _record(text)})
        beside = f"data: {text}\nsha256: {text}\nkind: {text}\nnote: {text}\n"
        yield Attack("file beside a table", tuple(f"check {_M} {_T}".split()), {"t.csv.provenance.yaml": beside})
        files = {"printer.cfg": printer.replace("288.0", json.loads(text).replace("\n", " "))}
        yield Attack("printer", ("new", "--from", "{i}/printer.cfg"), files)
        yield Attack("effect", ("check", "{i}/e.yaml"), {"e.yaml": overlay.replace("zero@q1", text)})
        yield Attack("size of an effect", ("check", "{i}/e.yaml"), {"e.yaml": overlay.replace("5 um", text)})
