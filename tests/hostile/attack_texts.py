"""What attackers write where a name, a number or a path is expected.

MARK becomes the mark of attacks, TOUCH a shell command that leaves a file of this name beside the results.
"""

from __future__ import annotations

CODE = (
    "__import__('os').system('TOUCH')",
    "open('MARK','w')",
    "eval('open(\"MARK\",\"w\")')",
    "exec('import MARK')",
    "().__class__.__bases__[0].__subclasses__()[0]('MARK')",
    "l1.__class__.MARK",
    "(lambda: MARK)()",
    "[MARK for MARK in (1,)]",
    "f'{MARK}'",
    "MARK if 1 else 2",
    "9**9**9**9**9",
    "9^9^9^9^9*1e308*10",
    "(" * 300 + "1" + ")" * 300,
    "-" * 400 + "1",
    "1/0 + MARK",
    "sqrt(-1e308)*exp(1e308)",
    "{{ ''.__class__.__mro__[1].__subclasses__() }} MARK",
    "{% for x in MARK %}{{ x }}{% endfor %}",
    "${jndi:ldap://127.0.0.1/MARK}",
    "$(TOUCH)",
    "`TOUCH`",
    "; TOUCH #",
    "| TOUCH",
    "%(MARK)s %n %s {0.__class__}",
    "=cmd|' /C TOUCH'!A0",
    "@SUM(1+1)*MARK",
    '=HYPERLINK("http://127.0.0.1/MARK")',
    "<script>fetch('http://127.0.0.1/MARK')</script>",
    "\"><img src=x onerror=MARK()>",
    "javascript:MARK()",
    "<svg onload=MARK()>",
    "$\\input{/etc/passwd} MARK$",
    "../../../../../../tmp/MARK",
    "/etc/passwd",
    "file:///etc/passwd#MARK",
    "\x1b]0;MARK\x07",
    "%0aMARK",
    "M110 ; MARK) M104 S999",
)
TAGS = (
    "!!python/object/apply:os.system ['TOUCH']",
    "!!python/object/new:subprocess.Popen [['touch', 'MARK']]",
    "!!python/name:os.system",
    "!!python/module:MARK",
    "!!python/object/apply:builtins.eval [\"open('MARK','w')\"]",
    "!<tag:yaml.org,2002:python/object/apply:os.system> ['TOUCH']",
    "!MARK 3",
    "!!binary TUFSSw==",
    "!!timestamp 2001-12-14",
    "!!set {MARK}",
    "!include /etc/passwd",
    "!ENV ${MARK}",
)
NAMES = (
    "a;MARK", "$(TOUCH)", "`MARK`", "|MARK", "-rf MARK", "a\x1b[2JMARK", "=MARK", "%MARK%", "{{MARK}}", "<b>MARK",
    "a\nMARK", "é\u202eMARK", "--MARK", "&MARK", "*MARK", "~MARK", "a'MARK\"", "$HOME MARK", "{0.__class__}MARK",
)  # fmt: skip
"""Of files and folders."""
BOMBS = {
    "aliases": "a: &a [1, 1, 1, 1, 1, 1, 1, 1, 1]\n"
    + "".join(f"{y}: &{y} [{', '.join([f'*{x}'] * 9)}]\n" for x, y in zip("abcdefgh", "bcdefghi")),
    "depth": "[" * 5000 + "]" * 5000,
    "maps": "{a: " * 3000 + "1" + "}" * 3000,
    "recursion": "a: &a [*a]\n",
    "merge": "a: &a {<<: *a}\n",
    "itself": "extends: m.yaml\n",
    "folder": "extends: .\n",
    "device": "extends: /dev/zero\n",
    "many": "space: planar\neach:\n  i: 1..1000000000\n",
    "long key": f"{'k' * 1_000_000}: 1\n",
    "long number": f"a: {'9' * 1_000_000}\n",
    "sexagesimal": "a: 1:1:1:1:1:1:1\n",
    "documents": "a: 1\n---\n" * 2000,
}
"""Machine files that are to use up time or memory."""
