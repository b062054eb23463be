"""The command lines that the fuzz runs, and what goes wrong in them: words lost, doubled, exchanged, mistyped.

`{m}` is a machine, `{t}` a table of it, `{p}` and `{q}` parameters, `{o}` a name for results. Lines that take long are
rare: each of a kind counts as often as its number says.
"""

from __future__ import annotations

import random
from collections.abc import Mapping

Lines = Mapping[str, int]

TABLE: Lines = {
    "simulate {m} {t}": 60, "check {m} {t}": 20, "check {m} {t} --json": 10, "check {m} {t} --format github": 6,
    "sensitivity {m} {t}": 10, "observability {m} {t} --json": 8, "simulate {m} {t} -p {p} --uncertainty": 6,
    "correct {m} {t} -p {p}": 3, "correct {m} {t} -p {p} --as csv": 1, "draw {m} {t} -o {o}.svg": 2,
    "calibrate {m} {t} --starts 1 --holdout none --json": 4, "calibrate {m} {t} --prior ranges": 1,
    "observability {m} {t}": 2, "effects {m} {t} --simulate": 1, "simulate {m} {t} --forces -o {o}.csv --json": 6,
    "compare {m} {m} {t}": 1, "improve {m} {t}": 1, "report {m} {t} -o {o}.html": 1,
}  # fmt: skip
MACHINE: Lines = {
    "check {m}": 20, "check {m} --json": 8, "sensitivity {m} --json": 8, "check {m} --format github": 4,
    "simulate {m} {t}": 8, "check {m} {t}": 8, "effects {m}": 4, "draw {m} -o {o}.svg": 2, "draw {m}": 2,
    "correct {m} {t}": 2, "observability {m} {t}": 2, "calibrate {m} {t} --starts 1 --holdout none": 1,
}  # fmt: skip
PARAMETERS: Lines = {
    "check {m} {t} -p {p}": 16, "simulate {m} {t} -p {p}": 16, "compare {q} {p}": 2, "compare {p} {q} --json": 1,
    "calibrate {m} {t} --prior {p} --starts 1 --holdout none": 2, "correct {m} {t} -p {p}": 2,
    "draw {m} -p {p}": 2, "report {m} {t} -p {p} -o {o}.html": 1,
}  # fmt: skip
OPTIONS: Lines = {
    "check {m} {t} -p {p} --tolerance 20um": 8, "simulate {m} --grid x=300:500:2,y=200:300:2 --seed 3": 12,
    "simulate {m} {t} --noise 5um --method linear -o {o}.csv": 8, "draw {m} {t} --row 2 --scale 100 -o {o}.svg": 4,
    "correct {m} --grid x=300:500:2,y=200:300:1 -p {p}": 3,
    "correct {m} {t} --as gcode-drives --feed 800 --dwell 0.5": 3,
    "effects": 6, "effects {m} --select zero@q1": 6, "effects {m} {t} --simulate --json": 2, "new rrr --span 500mm": 8,
    "new delta -o {o}.yaml --json": 4, "schema --overlay": 2, "schema --output check -o {o}.json": 4,
    "calibrate {m} {t} --select l1,l2 --starts 1 --holdout none": 4, "observability {m} {t} --select all --json": 6,
    "calibrate {m} {t} --loss huber --starts 2 --seed 7 --holdout none -o {o}.yaml": 2,
    "sensitivity {m} {t} --channel x --json": 8, "simulate --help": 2, "compare {p} {q} --alpha 0.05": 1,
    "study {m} --points 5 --repeat 2 --validation 2 --within x=300:600,y=200:300": 1,
    "plan {m} {t} --points 1 --seed 2 --as gcode": 1, "diagnose {m} {t} --alpha 0.05": 2,
    "improve {m} {t} -o {o}.yaml": 1, "report {m} {t} --tolerance 20um -o {o}.html": 1,
}  # fmt: skip
_WORDS = (
    "", " ", "-", "--", "0", "-1", "1.5", "1e3", "1e400", "nan", "inf", "x", "x=1", "x=0:1:0", "x=1:0:3", "x=::", "y=2",
    "x=0:1", "x=1:2:3:4", "x=0:500:2,x=1:2:2", "5,5", ",", "10 parsec", "20 um", "20um", "5 N", "+- 1", "é", "µm", "*",
    "q1", "@", "zero@", "zero@q9", "[", "(", "'", "..", "/nowhere/f.csv", "none", "auto", "all", "T=23", "T=x", "T=",
    "session", "exact", "rigid", "\u2212" + "1", "\x1b[31m", "a b", "=", "%", "1/0",
)  # fmt: skip
_OPTIONS = (
    "--json", "--grid", "-p", "--method", "--noise", "--seed", "--forces", "--uncertainty", "-o", "--plot", "-q",
    "--force", "-h", "--tolerance", "--format", "--select", "--holdout", "--loss", "--prior", "--loosen", "--starts",
    "--fail-above", "--max-rms", "--accept", "--at", "--redundant", "--as", "--dwell", "--feed", "--aim", "--budget",
    "--alpha", "--within", "--validation", "--machine", "--row", "--scale", "--simulate", "--span", "--from",
    "--channel", "--nothing", "--version",
)  # fmt: skip


def chosen(lines: Lines, rng: random.Random) -> str:
    """One of the lines."""
    return rng.choices(list(lines), list(lines.values()))[0]


def mistyped(words: list[str], rng: random.Random) -> list[str]:
    """The words of a line with one slip, or two; names of files stay whole."""
    for _ in range(rng.choice((1, 1, 2))):
        words = _slipped(list(words), rng)
    return words


def _slipped(words: list[str], rng: random.Random) -> list[str]:
    at, kind = rng.randrange(len(words)), rng.randrange(8)
    word, other = words[at], rng.randrange(len(words))
    if kind == 0:
        del words[at]
    elif kind == 1:
        words.insert(other, word)
    elif kind == 2:
        words[at], words[other] = words[other], word
    elif kind == 3:
        words.insert(at + 1, rng.choice(_OPTIONS))
    elif kind == 4:
        words[at + 1 : at + 1] = [rng.choice(_OPTIONS), rng.choice(_WORDS)]
    elif kind == 5 and "/" not in word and word:
        k = rng.randrange(len(word))
        words[at] = word[:k] + rng.choice(["", *"x9-=:,.@ ", word[k] * 2]) + word[k + 1 :]
    elif "/" not in word and (not word.startswith("-") or rng.random() < 0.3):
        words[at] = rng.choice(_WORDS)
    return words or ["-h"]
