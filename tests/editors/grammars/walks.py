"""Random texts of a grammar, from our rules and from GBNF as written, and what the checker has against them."""

from __future__ import annotations

import random
import re

import scenegen
from scenegen.api.feasibility import doubts
from scenegen.editors.grammars.rules import Alternation, Grammar, IntegerRange, Repeat, RuleRef, Seq, Terminal
from scenegen.errors import SpecError

SPECS = {
    "pair": "object mug, plate\ntask: leftOf(mug, plate)\n",
    "inferred": "closeTo(mug, plate)",
    "seen": "robot arm = panda at (0.5, -0.2, NORTH)\nobject mug, bottle\n"
    "camera front = at (0.5, -0.6, 0.7) looks at (0.5, 0.4, 0) fov 60 deg, 4:3\ntask: leftOf(mug, bottle)\n",
    "crowded": "object mug, plate, tray at (0.5, 0.5)\nobject block[2] = box(0.1, 0.1, 0.1) on tray\n"
    "region mat = rect(0.3, 0, 0.7, 0.2)\nconst NEAR = 20 cm\ndef near(a, b, e = NEAR) = dist(a, b) <= e\n"
    "require noCollision() & insideWorkspace()\nrequire easy\neasy: near(mug, plate, 60 cm)\ntask: near(mug, plate)\n",
    "usual": "workspace [-0.5, 0.5] x [-0.2, 0.2]\nobject mug, plate, jar[1..2]\n"
    "region mat = rect(-0.3, -0.1, -0.1, 0.1)\nregion far = rect(2, 2, 3, 3)\n"
    "object tray at (0, 0), can on any of [tray, workspace]\nusually theta(mug) ~ normal(theta(plate), 5 deg)\n"
    "task: leftOf(mug, plate)\n",
    "timed": "time 20 steps\nmoves one\nobject mug, plate\nrequire speed(mug) <= 20 cm/s\n"
    "task: eventually leftOf(mug, plate)\n",
}


STOP = 0.5  # of going on with a repetition


def derive(grammar: Grammar, rng: random.Random) -> str:
    """One text of the grammar: every choice is uniform."""
    out: list[str] = []
    stack = [grammar.rules[grammar.start]]
    while stack:
        part = stack.pop()
        match part:
            case Terminal(text):
                out.append(text)
            case RuleRef(name):
                stack.append(grammar.rules[name])
            case IntegerRange(low, high):
                out.append(str(rng.choice((low, high, rng.randint(low, high)))))
            case Seq(parts):
                stack.extend(reversed(parts))
            case Alternation(options):
                stack.append(rng.choice(options))
            case Repeat(one, least, most):
                count = least
                while count < most and rng.random() < STOP:
                    count += 1
                stack.extend([one] * count)
    return "".join(out)


TOKEN = re.compile(r'"(?:[^"\\]|\\.)*"|\[[0-9]-[0-9]\]|\{[0-9]+,[0-9]+\}|[a-z][a-z0-9]*|[()|?]|::=')
ESCAPES = {"\\n": "\n", '\\"': '"', "\\\\": "\\"}


def read_gbnf(text: str) -> Grammar:
    """A grammar from the GBNF that we write: texts, ranges of digits, names, groups, `|`, `?` and {m,n}."""
    rules = {}
    for line in text.splitlines():
        if line.startswith("#"):
            continue
        name, mark, *tokens = TOKEN.findall(line)
        assert mark == "::=", line
        part, rest = _options(tokens)
        assert not rest, line
        rules[name] = part
    return Grammar(rules, "root")


def _options(tokens):
    options, row = [], []
    while tokens and tokens[0] != ")":
        token, *tokens = tokens
        if token == "|":
            options.append(Seq(tuple(row)))
            row = []
        elif token == "(":
            part, tokens = _options(tokens)
            assert tokens[0] == ")"
            tokens = tokens[1:]
            row.append(part)
        elif token == "?":
            row[-1] = Repeat(row[-1], 0, 1)
        elif token.startswith("{"):
            least, most = map(int, token[1:-1].split(","))
            row[-1] = Repeat(row[-1], least, most)
        elif token.startswith("["):
            row.append(IntegerRange(int(token[1]), int(token[3])))
        elif token.startswith('"'):
            row.append(Terminal(re.sub(r"\\.", lambda found: ESCAPES[found.group()], token[1:-1])))
        else:
            row.append(RuleRef(token))
    return Alternation((*options, Seq(tuple(row)))), tokens


def refused(text):
    """What `scenegen check` has against a text."""
    try:
        spec = scenegen.parse(text)
    except SpecError as error:
        return str(error)
    return next((str(one.problem) for one in doubts(spec.definition) if one.proved), "")
