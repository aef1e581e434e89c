"""Random walks through the token mask of llguidance: what a model that knows nothing would say."""

import random
from pathlib import Path

import numpy
import pytest

import scenegen
from scenegen.editors.grammars.grammar import rules_of
from scenegen.editors.grammars.rules import json, lark
from tests.grammars.walks import SPECS, derive, refused

llguidance = pytest.importorskip("llguidance")

FOLDER = Path(__file__).parents[2] / "specs"
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
@pytest.mark.parametrize("write", [lark, json])
def test_a_few_walks_check(write):
    texts = walks(scenegen.parse(SPECS["pair"]), 20, write=write)
    assert {text: why for text in texts if (why := refused(text))} == {}


@pytest.mark.slow
@pytest.mark.parametrize("name", EVERY)
def test_all_walks_check(name):
    texts = walks(load(name), 3334)
    assert len(set(texts)) > 3000
    assert {text: why for text in texts if (why := refused(text))} == {}
