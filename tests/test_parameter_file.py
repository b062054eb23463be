"""Parameter files: what is written is read again, exactly; bad files with exact messages."""

from __future__ import annotations

import math
import re
from pathlib import Path

import pytest
import yaml
from hypothesis import example, given
from hypothesis import strategies as st

from pkmcal_cli.base.errors import BadInput
from pkmcal_cli.language.fingerprint import Fingerprint
from pkmcal_cli.loading.load_machine import load_machine, load_parameters
from pkmcal_cli.loading.parameter_file import read_parameters
from pkmcal_cli.loading.parameter_text import Correlations, ParameterEntry, dump_parameters, exact_value
from pkmcal_cli.model.parts import ModelParameter
from pkmcal_cli.units.unit_text import UNITS, parse_unit
from tests.command import MACHINES, TRIGLIDE, run
from tests.in_ci import in_ci

HERE = Path(__file__).parent
BAD = sorted(path.stem for path in (HERE / "bad" / "parameters").glob("*.yaml"))


def parameter(name: str, unit: str, dimension: str = "length") -> ModelParameter:
    return ModelParameter(
        name=name, nominal=0.0, range=1.0, bounds=(-math.inf, math.inf), unit=unit, dimension=dimension, identify=True
    )


@pytest.mark.parametrize("name", BAD)
def test_bad_parameter_files_say_exactly_what_is_wrong(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(HERE / "bad" / "parameters")
    done = run("sensitivity", TRIGLIDE, "-p", f"{name}.yaml", "-q")
    assert done.code == 3 and done.err == Path(f"{name}.expected").read_text()


def test_values_may_be_written_by_hand(tmp_path: Path) -> None:
    file = tmp_path / "p.yaml"
    file.write_text(
        "parameters:\n  l1: 300.5\n  l2: 0.3001 m\n  l3: {value: 60.01, unit: cm}\n  gamma: {value: '1 mrad'}\n"
        "  xb1r: {value: 12 um, std: null, identified: false, note: guessed}\n  k1: 5e4\n  yb1r: 100 # comment\n"
    )
    model = load_machine(TRIGLIDE).model
    start = load_parameters(model, str(file))
    found = dict(zip(model.names, start.values, strict=True))
    wanted = {"l1": 0.3005, "l2": 0.3001, "l3": 0.6001, "gamma": 1e-3, "xb1r": 12e-6, "k1": 5e7, "yb1r": 0.1}
    assert {k: found[k] for k in wanted} == pytest.approx(wanted)
    assert found["k2"] == 5e7, "what the file lacks stays nominal"
    assert list(start.inputs) == [str(file)]
    assert start.warnings == (f"note: {file}: no fingerprint: cannot check which machine these values belong to",)


NUMBERS = st.floats(-1e6, 1e6).filter(lambda x: x == 0 or abs(x) > 1e-200)


@given(NUMBERS, st.sampled_from(["mm", "um", "m", "deg", "rad", "kN/mm", "N/mm", "GPa"]))
@example(0.3, "mm")
@example(math.radians(1), "deg")
@example(-0.0, "mm")
def test_a_value_in_its_unit_reads_back_as_it_was(si: float, unit: str) -> None:
    """To the last bit, or to the nearest number that the unit can express."""
    back = parse_unit(unit).to_si(exact_value(si, parse_unit(unit)))
    assert back == si or abs(back - si) <= math.ulp(si)


@given(st.decimals(-10000, 10000, allow_nan=False, places=4), st.sampled_from(sorted(UNITS)))
def test_a_value_that_was_written_is_written_again(number: object, unit: str) -> None:
    """A nominal value of 300.1 mm does not become 300.09999999999997 mm."""
    value = float(str(number))
    back = exact_value(parse_unit(unit).to_si(value), parse_unit(unit))
    assert len(repr(back)) <= len(repr(value)) or parse_unit(unit).offset


NAMES = st.from_regex(r"[A-Za-z][A-Za-z0-9_]{0,8}(@[a-z]{1,3}\.b)?(\[s1\])?", fullmatch=True)


@given(
    st.dictionaries(
        NAMES, st.tuples(st.floats(allow_nan=False, allow_infinity=False), st.booleans()), min_size=1, max_size=6
    )
)
@example({"y": (1e-06, True), "no": (1e300, False), "null": (-0.0, True), "off": (5e-324, True)})
def test_files_are_read_as_they_were_written(values: dict[str, tuple[float, bool]]) -> None:
    """By us and by any other YAML reader, whatever the names and numbers."""
    import tempfile

    entries = [ParameterEntry(n, v, abs(v) if i else None, "m", i) for n, (v, i) in values.items()]
    matrix = [[1.0] * len(values)] * len(values)
    text = dump_parameters(
        entries,
        Correlations(list(values), [1.0] * len(values), matrix),
        {"status": "converged", "arguments": ["a: b", "#", "é"]},
        Fingerprint(),
    )
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "p.yaml"
        file.write_text(text, encoding="utf-8")
        found = read_parameters(str(file), [parameter(n, "m") for n in values], Fingerprint())
    assert dict(found.values) == {n: v for n, (v, _) in values.items()}
    assert found.ending.status == "converged"
    other = yaml.safe_load(text)
    assert other["parameters"] == {e.name: other_entry(e) for e in entries}
    assert other["correlations"]["names"] == list(values)
    assert other["provenance"]["arguments"] == ["a: b", "#", "é"]


def other_entry(entry: ParameterEntry) -> dict[str, object]:
    return {"value": entry.value, "std": entry.std, "unit": entry.unit, "identified": entry.identified}


def test_a_plain_number_has_no_unit() -> None:
    text = dump_parameters([ParameterEntry("f", 2.0, 0.1, "1", True)], None, {}, Fingerprint())
    assert "f: {value: 2.0, std: 0.1, identified: true}" in text and "correlations" not in text


def test_undetermined_correlations_are_null() -> None:
    text = dump_parameters([], Correlations(["a"], [1.0], [[math.nan]]), {}, Fingerprint())
    assert "- [null]" in text


@pytest.mark.parametrize(
    "machine",
    in_ci(
        ["triglide", "hangprinter", "delta4"], ["triglide", "scissors", "hangprinter", "hexapod7", "delta4", "biglide"]
    ),
)
def test_every_command_takes_the_file_that_calibrate_writes(
    machine: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    file = str(MACHINES / f"{machine}.yaml")
    data = str(MACHINES / ("hangprinter_2021-12-16.csv" if machine == "hangprinter" else f"{machine}.csv"))
    assert run("calibrate", file, data, "--holdout", "none", "-o", "p.yaml").code == 0
    model = load_machine(file).model
    written = yaml.safe_load(Path("p.yaml").read_text())["parameters"]
    read = load_parameters(model, "p.yaml").values
    for p, value in zip(model.parameters, read, strict=True):
        assert parse_unit(p.unit or "1").to_si(written[p.name]["value"]) == value
    assert run("simulate", file, data, "-p", "p.yaml", "-o", "s.csv").code == 0
    for command in ("sensitivity", "observability"):
        assert run(command, file, "-p", "p.yaml").code == 0
    again = run("calibrate", file, data, "-p", "p.yaml", "--holdout", "none", "--json", "-o", "q.yaml")
    assert again.code == 0 and again.json["status"] == "converged"


def test_a_file_of_another_machine_is_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    Path("p.yaml").write_text("parameters: {Ax: 5}\n")
    with pytest.raises(BadInput, match="no parameter `Ax`"):
        load_parameters(load_machine(TRIGLIDE).model, "p.yaml")


def test_values_outside_the_bounds_are_told(tmp_path: Path) -> None:
    machine, file = tmp_path / "m.yaml", tmp_path / "p.yaml"
    machine.write_text(f"extends: {TRIGLIDE}\nparameters: {{l1: {{bounds: [299.9, 300.1]}}}}\n", encoding="utf-8")
    for value, outside in ((300.05, False), (301, True)):
        file.write_text(f"parameters: {{l1: {value}, l2: 300.2}}", encoding="utf-8")
        done = run("sensitivity", machine, "-p", file)
        assert done.code == 0 and ("outside the bounds of the machine file: l1\n" in done.err) == outside


def test_correlations_of_no_names_are_as_good_as_none(tmp_path: Path) -> None:
    file = tmp_path / "p.yaml"
    text = dump_parameters(
        [ParameterEntry("f", 2.0, 0.1, "1", True)], Correlations(["f"], [0.1], [[1.0]]), {}, Fingerprint()
    )
    for names, whole in (("[f]", True), ("3", False), ("{f: 1}", False)):
        file.write_text(re.sub(r"names: .*", f"names: {names}", text), encoding="utf-8")
        found = read_parameters(str(file), [parameter("f", "1")], Fingerprint())
        assert (found.covariance is not None) == whole
