"""`compare`: one test of all that data sets determine in common; what changed; a trend; machine files; refusals."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest

from pkmcal_cli.calibration.comparison import alone, changed, changes, holm, omnibus
from pkmcal_cli.calibration.data_sets import common
from pkmcal_cli.calibration.paired_errors import paired
from pkmcal_cli.loading.data_information import DataInformation
from tests.campaign_tables import MM, true_values, write_table
from tests.command import MACHINES, Done, run
from tests.compare_campaigns import SUBJECTS, changed_pair, null_pair

TWO_LEGS = "triglide-nonredundant"
BIGLIDE, SCISSORS, PLAIN = (str(MACHINES / f"{name}.yaml") for name in ("biglide", "scissors", TWO_LEGS))


@pytest.fixture(autouse=True)
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    return tmp_path


_WRITTEN: dict[tuple[object, ...], str] = {}


def calibrated(name: str, table: str, *options: str, machine: str = BIGLIDE) -> str:
    """A parameter file; the same rows, machine and options are calibrated once for all tests."""
    asked = (machine, Path(machine).read_text(), table, Path(table).read_text(), options)
    if asked not in _WRITTEN:
        done = run("calibrate", machine, table, "-o", f"{name}.yaml", "-q", "--holdout", "none", *options)
        assert done.code == 0, done.err
        _WRITTEN[asked] = Path(f"{name}.yaml").read_text()
    Path(f"{name}.yaml").write_text(_WRITTEN[asked])
    return f"{name}.yaml"


def table(name: str, seed: int, rows: int = 40, machine: str = "biglide", **changed: float) -> str:
    """Rows of one machine, perhaps changed."""
    return write_table(Path(f"{name}.csv"), machine, true_values(machine, 5, **changed), seed, rows)


def compared(*arguments: str) -> Done:
    done = run("compare", *arguments, "--json")
    assert done.code in (0, 1), done.err
    return done


def linear(seed: int, theta: np.ndarray, rows: int = 30, of: int = 0, noise: float = 1.0) -> DataInformation:
    """What a linear problem says of 4 parameters of size 1, the last of which is never seen."""
    rng = np.random.default_rng([seed, of])
    jacobian = rng.normal(size=(rows, 4)) * [3.0, 2.0, 1.0, 0.0]
    upper = np.linalg.qr(np.column_stack([jacobian, jacobian @ theta + noise * rng.normal(size=rows)]), mode="r")
    names = ("a", "b", "c", "d")
    return DataInformation(
        names=names, scale=np.ones(4), root=upper[:4, :4], right=upper[:4, 4], left=float(upper[4, 4] ** 2),
        count=rows, worth=1e-6,
    )  # fmt: skip


def test_the_test_is_exact_in_linear_problems() -> None:
    """F distributed with any parameters, whatever each fit held them at; three combinations are seen by both."""
    p_values = []
    for seed in range(400):
        theta = np.random.default_rng([7, seed]).normal(size=4) * 3
        held = [dict(zip("abcd", v, strict=True)) for v in np.random.default_rng([8, seed]).normal(size=(2, 4))]
        data = [linear(seed, theta - list(h.values()), of=k, noise=1.7) for k, h in enumerate(held)]
        test, _ = omnibus(common(data, held, [set(), set()]))
        assert test.dof == 3
        p_values.append(test.p_value)
    assert np.mean(np.array(p_values) < 0.05) == pytest.approx(0.05, abs=0.033)  # three standard deviations
    assert np.mean(np.array(p_values) < 0.5) == pytest.approx(0.5, abs=0.075)


def test_changes_are_those_of_least_squares() -> None:
    """Two sets that see three parameters: the difference of both estimates; nothing of the one that none sees."""
    one, other = np.array([1.0, -2.0, 0.5, 0.0]), np.array([1.0, 2.0, 0.5, 0.0])
    data = [linear(1, one, 200, 0), linear(1, other, 200, 1)]
    zero = dict.fromkeys("abcd", 0.0)
    c = common(data, [zero, zero], [set(), set()])
    found = changes(c, ("a", "b", "c", "d"), (0.0, 1.0), omnibus(c)[0].freedom)
    alone = [np.linalg.lstsq(d.root[:3, :3], d.right[:3], rcond=None)[0] for d in data]
    assert found.values[:3] == pytest.approx(alone[1] - alone[0], abs=0.02)  # its weak prior is 4
    assert found.determined.tolist() == [True, True, True, False] and np.isnan(found.holm[3])
    assert found.holm[1] < 1e-6 and found.holm[0] > 0.05 < found.holm[2]


def test_a_single_change_that_some_fit_held_is_named() -> None:
    """What was held and has changed is put down to others, by their own tests; the shortest explanation is named."""
    one, other = np.array([0.0, 1.0, 0.5, 0.0]), np.array([1.5, 1.0, 0.5, 0.0])  # a has changed, b and c have not
    data = [linear(3, one, 60, 0, 0.05), linear(3, other, 60, 1, 0.05)]
    c = common(data, [dict.fromkeys("abcd", 0.0)] * 2, [set(), set()])
    test, contrasts = omnibus(c)
    found, single = changes(c, ("b", "c"), (0.0, 1.0), test.freedom), alone(c, contrasts, test, (0.0, 1.0))
    assert single is not None and single.name == "a" and single.explains and single.sufficient == ("a",)
    assert (found.holm < 0.05).any()  # put down to what was free
    assert changed(found, single, test, 0.05) == ("a",)


def test_holm() -> None:
    """Aickin, Gensler 1996: each p value times the number of those not smaller, never falling."""
    assert holm(np.array([0.01, 0.04, np.nan, 0.03])) == pytest.approx([0.03, 0.06, np.nan, 0.06], nan_ok=True)


@pytest.mark.slow
def test_selection_prior_and_what_is_held_do_not_matter() -> None:
    """The same rows, calibrated otherwise: the same test, to what is not linear."""
    a, b = table("a", 1), table("b", 2)
    one = calibrated("one", a)
    others = [
        calibrated("plain", b),
        calibrated("ranges", b, "--prior", "ranges"),
        calibrated("few", b, "--select", "auto,-l1,-xb2r"),
    ]
    tests = [compared(one, other).json["test"] for other in others]
    first = tests[0]
    assert first["degrees_of_freedom"] >= 6
    for test in tests:
        assert test["statistic"] == pytest.approx(first["statistic"], rel=0.1)
        assert abs(test["degrees_of_freedom"] - first["degrees_of_freedom"]) <= 1


def test_an_unchanged_machine() -> None:
    one, two = (table(name, seed, machine=TWO_LEGS) for name, seed in (("a", 1), ("b", 2)))
    done = compared(calibrated("one", one, machine=PLAIN), calibrated("two", two, machine=PLAIN))
    found, tool = done.json, done.json["tool_point"]
    assert done.code == 0 and found["verdict"] == "no change" and found["named"] == []
    assert tool["rms"] < 3 * tool["rms_by_chance"] and tool["over"] == "measured travel"
    assert "no change" in done.err and {f["file"] for f in found["files"]} == {"one.yaml", "two.yaml"}


def test_a_changed_strut_is_named() -> None:
    first = calibrated("one", table("a", 1, machine="scissors"), machine=SCISSORS)
    changed = table("b", 2, machine="scissors", l3=0.04 * MM)
    done = compared(first, calibrated("two", changed, machine=SCISSORS))
    found = done.json
    assert done.code == 1 and found["verdict"] == "changed" and found["named"] == ["l3"]
    assert found["alone"]["name"] == "l3" and found["alone"]["change"] == pytest.approx(0.04, rel=0.1)
    (l3,) = (p for p in found["parameters"] if p["name"] == "l3")
    assert abs(l3["change"] - 0.04) < 3 * l3["std"] and l3["changed"]
    assert found["tool_point"]["rms"] > 3 * found["tool_point"]["rms_by_chance"] > 0


def test_a_changed_strut_that_no_fit_identified_is_named() -> None:
    """Parameters that were free take up its change; the table says that they need not have changed."""
    held = ("--select", "auto,-l3,-y8")
    one, two = calibrated("one", table("a", 1), *held), calibrated("two", table("b", 2, l3=0.4 * MM), *held)
    done = compared(one, two)
    named = done.json["named"]
    assert done.code == 1 and "l3" in named and done.json["alone"]["explains"]
    by_itself = {p["name"] for p in done.json["parameters"] if (p["p_value_holm"] or 1) < 0.05}
    assert by_itself and not by_itself & set(named)
    assert done.err.count("alone explains all") == len(by_itself)
    assert not any(p["changed"] for p in done.json["parameters"])


@pytest.mark.slow
def test_campaigns_of_unchanged_machines() -> None:
    """A small part of docs/verify-and-compare.md: more than 4 alarms in 25 come by chance in 0.7 % of such runs."""
    found = [null_pair(SUBJECTS[0], seed).test.p_value < 0.05 for seed in range(25)]
    assert sum(found) <= 4


@pytest.mark.slow
def test_campaigns_of_changed_machines() -> None:
    found = [changed_pair(SUBJECTS[0], seed) for seed in range(8)]
    assert all(c.test.p_value < 0.05 for _, c in found)
    assert all(c.alone is not None and s in c.alone.names for s, c in found)


def test_the_same_rows_twice_are_told() -> None:
    one = calibrated("one", table("a", 1, machine=TWO_LEGS), machine=PLAIN)
    done = compared(one, calibrated("two", "a.csv", "--select", "all", machine=PLAIN))
    assert "share rows" in done.err and "the tests do not hold" in done.err


def dated(file: str, created: str) -> str:
    """The file as if it had been written then."""
    text = Path(file).read_text()
    Path(file).write_text(re.sub(r"created: .*", f"created: '{created}'", text))
    return file


def test_a_trend() -> None:
    """A strut that grows by 30 um in ten days."""
    files = []
    for day in (0, 10, 20, 30):
        file = calibrated(f"p{day}", table(f"t{day}", day, machine="scissors", l4=3e-6 * day), machine=SCISSORS)
        files.append(dated(file, f"2026-05-{1 + day:02d}T08:00:00+00:00"))
    found = compared(*files).json
    (l4,) = (p for p in found["parameters"] if p["name"] == "l4")
    assert found["per"] == "day" and "l4" in found["named"]
    assert l4["change"] == pytest.approx(3e-3, rel=0.1)  # mm per day
    assert abs(l4["change"] - 3e-3) < 3 * l4["std"]


@pytest.mark.slow
def test_a_step_is_no_trend() -> None:
    """A strut that is another one from the last file on: a line through all would name other parameters."""
    files = []
    for day, more in ((0, {}), (10, {}), (20, {"l1": 0.2e-3})):
        file = calibrated(f"p{day}", table(f"t{day}", day, **more))
        files.append(dated(file, f"2026-05-{1 + day:02d}T08:00:00+00:00"))
    found = compared(files[2], files[0], files[1]).json
    assert found["since"] == files[2] and found["per"] is None and found["named"] == ["l1"]
    assert found["alone"]["name"] == "l1" and abs(found["alone"]["change"] - 0.2) < 4 * found["alone"]["std"]
    assert compared(*files[:2]).json["since"] is None


def test_a_trend_needs_dates() -> None:
    rows = [calibrated(f"p{k}", table(f"t{k}", k, 20)) for k in range(3)]
    done = run("compare", rows[0], rows[1], dated(rows[2], "soon"))
    assert done.code == 3 and "needs the date" in done.err


def test_what_has_no_partner_is_listed() -> None:
    """A machine file that has since got an effect: parameters by name, no fingerprint asked for."""
    Path("wound.yaml").write_text(f"extends: {PLAIN}\neffects: {{scale@q1: {{s: {{identify: true}}}}}}\n")
    one, two = (table(name, seed, machine=TWO_LEGS) for name, seed in (("a", 1), ("b", 2)))
    done = compared(calibrated("one", one, machine=PLAIN), calibrated("two", two, machine="wound.yaml"))
    (effect,) = done.json["effects"]
    assert effect["name"] == "scale@q1.s" and effect["remark"] == "only in B" and effect["values"][0] is None
    assert {"name": "scale@q1.s", "files": ["two.yaml"]} in done.json["apart"]
    assert "differs from that of" in done.err and "without partner, only in B: scale@q1.s" in done.err


def test_machines_that_have_nothing_in_common() -> None:
    other = calibrated("two", table("b", 1, machine="scissors"), machine=SCISSORS)
    done = compared(calibrated("one", table("a", 1)), other)
    assert done.code == 1 and done.json["verdict"] == "nothing in common" and done.json["named"] == []
    assert {a["name"] for a in done.json["apart"]} >= {"x8", "ya1"}


def test_machine_files_on_the_same_rows() -> None:
    """A joint in a wrong place."""
    held = "x8: {nominal: 361, identify: false}, l3: {identify: false}"
    Path("short.yaml").write_text(f"extends: {BIGLIDE}\nparameters: {{{held}}}\n")
    done = compared(BIGLIDE, "short.yaml", table("a", 1, 60))
    assert (found := done.json)["kind"] == "machines" and found["of"] == "position" and found["count"] == 60
    assert done.code == 0 and found["better"] == BIGLIDE and found["change"]["low"] > 0
    same = compared(BIGLIDE, BIGLIDE, "a.csv").json
    assert same["better"] is None and same["change"]["value"] == 0


def test_shipped_machines_are_called_by_their_names() -> None:
    done = compared("triglide", "triglide-nonredundant", str(MACHINES / "triglide.csv"))
    assert done.code == 0 and done.json["count"] > 0
    assert [Path(m).stem for m in done.json["machines"]] == ["triglide", "triglide-nonredundant"]


def test_pairs_are_resampled_together() -> None:
    """An error that both share says nothing; a small one that one has more in every row does."""
    shared = np.random.default_rng(1).normal(size=80) ** 2
    found = paired(shared, shared + 0.05, np.arange(80))
    assert found.low > 0 and found.better == 1
    assert found.second == pytest.approx(np.sqrt((shared + 0.05).mean()))
    assert paired(shared, shared[::-1], np.arange(80)).better == 0


@pytest.mark.parametrize(
    ("arguments", "code", "told"),
    [
        (["one.yaml"], 2, "nothing to compare"),
        (["one.yaml", "-"], 2, "no stdin"),
        (["one.yaml", "plain.yaml"], 3, "no complete section `data`"),
        (["one.yaml", "list.yaml"], 3, "must be a map"),
        (["one.yaml", "words.yaml"], 3, "neither"),
        (["one.yaml", "none.yaml"], 3, "error[file]"),
        (["one.yaml", "a.csv"], 2, "by machine files"),
        ([BIGLIDE, "a.csv"], 2, "in pairs"),
        (["empty"], 3, "no run"),
        (["one.yaml", "empty"], 2, "not the folder of one run"),
        (["one.yaml", "spoilt.yaml"], 3, "no complete section `data`"),
        (["one.yaml", "one.yaml", "--alpha", "2"], 2, "--alpha"),
        (["one.yaml", "other.yaml", "--machine", "none.yaml"], 3, "error[file]"),
    ],
)
def test_odd_arguments(arguments: list[str], code: int, told: str, folder: Path) -> None:
    one = Path(calibrated("one", table("a", 1, 20))).read_text()
    (folder / "other.yaml").write_text(one)
    (folder / "plain.yaml").write_text("parameters: {l1: {value: 300, unit: mm}}\n")
    (folder / "list.yaml").write_text("[1, 2]\n")
    (folder / "words.yaml").write_text("hello: world\n")
    (folder / "spoilt.yaml").write_text(re.sub(r"  right: \[.*?,", "  right: [0.1, 0.2,", one))
    (folder / "empty").mkdir()
    done = run("compare", *arguments)
    assert done.code == code and told in done.err, done.err
    assert "Traceback" not in done.err
