"""Whatever a grammar makes, the checker takes: derivations of its rules, and of GBNF, are specs without a mistake.
Random walks through the token mask of llguidance: what a model that knows nothing would say.
"""

import json
import random
from functools import cache
from pathlib import Path

import numpy
import pytest

import scenegen
from scenegen.editors.grammars.grammar import rules_of
from scenegen.editors.grammars.rules import Alternation, Repeat, RuleRef, Seq, gbnf, lark, pattern
from scenegen.editors.grammars.rules import json as as_json
from scenegen.editors.grammars.rules import json as json_masks
from scenegen.errors import RequestError, SpecError
from tests.editors.grammars.walks import SPECS, derive, read_gbnf, refused

LONG = pytest.mark.long
DERIVATIONS = {"pair": 30, "timed": 30, "inferred": 30, "crowded": 12, "usual": 30}
NAMES = ["pair", "timed", *(pytest.param(name, marks=LONG) for name in ("inferred", "crowded", "usual"))]


@cache
def rules_for(name):
    return rules_of(scenegen.parse(SPECS[name]))


@pytest.mark.long
@pytest.mark.parametrize("name", NAMES)
def test_random_derivations_check(name):
    grammar, rng, count = rules_for(name), random.Random(0), DERIVATIONS[name]
    texts = [derive(grammar, rng) for _ in range(count)] + [derive(read_gbnf(gbnf(grammar)), rng) for _ in range(5)]
    assert len(set(texts)) > 0.9 * count
    assert {text: why for text in texts if (why := refused(text))} == {}


@LONG
def test_what_no_scene_satisfies_is_left_out():
    text = "object mug, plate\nrequire clearOf(mug, plate, 10 cm)\ntask: leftOf(mug, plate)\n"
    written = lark(rules_of(scenegen.parse(text)))
    assert '"leftOf("' in written and '"clearOf("' in written
    assert "overlaps(p, q)" not in written and '"overlaps(" args1 ")"' not in written
    assert refused(text + "goal1: overlaps(mug, plate)\n")


@LONG
def test_labels_that_others_use_stay():
    start = derive(rules_for("crowded"), random.Random(1))
    assert "easy: near(mug, plate, 60 cm)" in start and "task:" not in start


@LONG
def test_a_definition_of_the_spec_takes_part():
    assert '"near("' in lark(rules_for("crowded")) and '"near("' not in lark(rules_for("pair"))


@LONG
def test_every_relation_takes_part():
    from scenegen.lang.check.scope import prelude
    from scenegen.lang.syntax import ast

    written = lark(rules_for("crowded")) + lark(rules_for("seen"))
    names = [one.name.id for one in prelude().statements if isinstance(one, ast.Definition)]
    # of constant heights these say nothing, and a point is no statement
    left_out = {"mirrorImage"}
    assert {name for name in names if f"{name}(" not in written} <= left_out | {"atLevel", "underneath", "stacked"}


@pytest.mark.long
def test_words_of_time_where_there_is_time():
    timed, still = lark(rules_for("timed")), lark(rules_for("pair"))
    for word in ("always", "until_with", "initially", "displacement(", " cm/s"):
        assert word in timed and word not in still


@LONG
def test_where_things_usually_are_is_said_once_of_each():
    rng = random.Random(2)
    usual, timed = ("\n".join(derive(rules_for(name), rng) for _ in range(60)) for name in ("usual", "timed"))
    said = ("usually mug ~ normal((", "usually jar ~ [uniform(", "normal(mat, ", "normal(tray, ", "normal(theta(plate)")
    for words in said:
        assert words in usual
    # said by the spec itself, held, outside of the workspace, not always there, on something
    wrong = ("usually theta(mug) ~ normal(W", "usually tray", "normal(far", "normal(jar[2]", "usually can ~ normal((")
    for words in (*wrong, "normal(mug", "normal(can"):
        assert words not in usual
    assert "usually plate ~ normal(mug, " in timed and "usually mug ~ normal(plate" not in timed
    assert "usually theta(can)" not in lark(rules_of(scenegen.parse(SPECS["usual"]), only="labels"))


@pytest.mark.long
def test_formulas_nest_and_parse():
    grammar, rng = rules_of(scenegen.parse(SPECS["pair"]), shape="formulas"), random.Random(0)
    for _ in range(30):
        scenegen.parse(derive(grammar, rng))  # raises for a mistake; a contradiction is none


def test_all_rules_are_there_and_used():
    for grammar in map(rules_for, ("pair", "timed")):
        stack, used = [RuleRef(grammar.start)], set()
        while stack:
            part = stack.pop()
            if isinstance(part, RuleRef) and part.name not in used:
                used.add(part.name)
                stack.append(grammar.rules[part.name])
            elif isinstance(part, Seq | Alternation):
                stack.extend(part.parts if isinstance(part, Seq) else part.options)
            elif isinstance(part, Repeat):
                stack.append(part.part)
        assert used == grammar.rules.keys()


def test_gbnf_has_the_same_rules():
    grammar = rules_for("pair")
    assert list(read_gbnf(gbnf(grammar)).rules) == ["root", *list(grammar.rules)[1:]]


def test_ranges_of_numbers():
    import re

    for low, high in ((0, 9), (1, 100), (5, 50), (8, 25), (99, 1234), (7, 7), (1, 20)):
        wanted = re.compile(pattern(low, high))
        assert [n for n in range(1500) if wanted.fullmatch(str(n))] == list(range(low, high + 1))
        assert not wanted.fullmatch(f"0{low}")


@pytest.mark.long
def test_dialects_of_names(golden):
    written = scenegen.grammar_of(["mug"])
    golden("editors/grammars/mug.lark", written)
    grammar = rules_of(["mug"], only="labels")
    assert json.loads(as_json(grammar))["grammars"][0]["lark_grammar"] == lark(grammar)
    assert gbnf(grammar).startswith("root ::= goal1\n")


def test_refusals():
    for words in ({"to": "bnf"}, {"shape": "all"}, {"only": "task"}):
        with pytest.raises(RequestError, match="unknown"):
            scenegen.grammar_of(["mug"], **words)
    with pytest.raises(SpecError):
        scenegen.grammar_of(["9mug"])


llguidance = pytest.importorskip("llguidance")

FOLDER = Path(__file__).parents[3] / "specs"
EVERY = {"table_setting": None, "breakfast": None, "timed": SPECS["timed"]}


class Pieces:
    """A tokenizer: all bytes, the end, and pieces of a few characters as they occur in texts."""

    def __init__(self, texts, rng, count=1000):
        pieces = set()
        while len(pieces) < count:
            text = rng.choice(texts)
            start = rng.randrange(len(text))
            pieces.add(text[start : start + rng.randint(2, 6)].encode())
        self.tokens = [bytes([one]) for one in range(256)] + sorted(pieces - {bytes([one]) for one in range(256)})
        self.tokens.append(b"\xff[")  # llguidance marks special tokens so
        self.eos_token_id = len(self.tokens) - 1
        self.bos_token_id = None
        self.special_token_ids = [self.eos_token_id]

    def __call__(self, text):
        return list(text if isinstance(text, bytes) else text.encode())


def walked(matcher, pieces, rng):
    """One text, each token uniform among those that the mask allows."""
    matcher.reset()
    out = b""
    while True:
        allowed = numpy.flatnonzero(
            numpy.unpackbits(numpy.frombuffer(matcher.compute_bitmask(), dtype=numpy.uint8), bitorder="little")
        )
        token = int(rng.choice(allowed))
        if token == pieces.eos_token_id:
            return out.decode()
        assert matcher.consume_token(token), matcher.get_error()
        out += pieces.tokens[token]
        assert not matcher.is_error(), matcher.get_error()
        if matcher.is_stopped():
            return out.decode()


def walks(spec, count, seed=0, write=lark, **options):
    """So many texts."""
    rng, grammar = random.Random(seed), rules_of(spec, **options)
    pieces = Pieces([derive(grammar, rng) for _ in range(200)], rng)
    tokenizer = llguidance.LLTokenizer(llguidance.TokenizerWrapper(pieces))
    matcher = llguidance.LLMatcher(tokenizer, write(grammar))
    assert not matcher.is_error(), matcher.get_error()
    return [walked(matcher, pieces, rng) for _ in range(count)]


def load(name):
    return scenegen.load(FOLDER / f"{name}.spec") if EVERY[name] is None else scenegen.parse(EVERY[name])


@pytest.mark.long
@pytest.mark.parametrize("write", [lark, json_masks])
def test_a_few_walks_check(write):
    texts = walks(scenegen.parse(SPECS["pair"]), 20, write=write)
    assert {text: why for text in texts if (why := refused(text))} == {}


@pytest.mark.slow
@pytest.mark.parametrize("name", EVERY)
def test_all_walks_check(name):
    texts = walks(load(name), 3334)
    assert len(set(texts)) > 3000
    assert {text: why for text in texts if (why := refused(text))} == {}
