"""Damage to good specs: what typing errors, merge accidents and other programs do to a text, and plain noise."""

from __future__ import annotations

import random
from collections.abc import Sequence

from scenegen.lang.syntax.tokens import KEYWORDS, scan

from .generate import Case
from .phrases import EXTREMES

SIGNS = "( ) [ ] { } , : . .. = == -> & | ! && || <= >= < > + - * / ; @ $ % ^ ~ ? \\ ' \" ` # ∧ ∨ ¬ → ≤ ∀ ∃ ⊤ ⊥".split()
ODD = "\t \r \n \0 \x0b \x85 \u00a0 \u2028 \ufeff \u202e \ud7ff é 😀 ﬁ ² ١ 𝐱".split(" ")
NOISE = b"\xff \xc3 \x00 \xed\xa0\x80 \xf4\x90\x80\x80 \xef\xbb\xbf \r \xe2\x88 \x1b[31m".split(b" ")
DEEP = [("(", ")"), ("[", "]"), ("!", ""), ("-", ""), ("abs(", ")"), ("forall p in objects: ", ""), ("not ", "")]


def pieces(text: str) -> list[str]:
    """Tokens and what stands between them, so that joining gives the text back."""
    out, end = [], 0
    for token in scan(text):
        if token.start > end:
            out.append(text[end : token.start])
        out.append(token.text)
        end = token.end
    return [*out, text[end:]]


def damage(text: str, rng: random.Random, others: Sequence[str]) -> str:
    """One change of a text."""
    parts = pieces(text)
    at, to = rng.randrange(len(parts)), rng.randrange(len(parts))
    match rng.randrange(15):
        case 0:
            del parts[at]
        case 1:
            parts.insert(at, parts[at])
        case 2:
            parts[at], parts[to] = parts[to], parts[at]
        case 3:
            parts[at] = parts[to]
        case 4:
            parts.insert(at, rng.choice(SIGNS))
        case 5:
            parts.insert(at, f" {rng.choice(sorted(KEYWORDS))} ")
        case 6:
            parts.insert(at, rng.choice(ODD))
        case 7:
            numbers = [place for place, part in enumerate(parts) if part[:1].isdigit()]
            if numbers:
                parts[rng.choice(numbers)] = rng.choice(EXTREMES)
        case 8:
            opening, closing = rng.choice(DEEP)
            times = rng.choice([2, 30, 300])
            parts[at] = opening * times + parts[at] + closing * (times if rng.random() < 0.8 else times - 1)
        case 9:
            low, high = sorted((at, to))
            del parts[low : min(high, low + 20)]
        case 10:
            low, high = sorted((at, to))
            parts[at:at] = parts[low : min(high, low + 40)] * rng.choice([1, 2, 5])
        case 11:
            other = pieces(rng.choice(others))
            low = rng.randrange(len(other))
            parts[at:at] = other[low : low + rng.randrange(1, 30)]
        case 12:
            parts[at] = rng.choice("a1 _(\t#.-\n") * rng.choice([50, 600, 20_000])
        case 13:
            return text[: rng.randrange(len(text) + 1)]
        case _:
            where = rng.randrange(len(text) + 1)
            return text[:where] + rng.choice([*ODD, *SIGNS, *"abcxyz019 "]) + text[where + rng.randrange(2) :]
    return "".join(parts)


def mutate(rng: random.Random, texts: Sequence[str]) -> Case:
    """One of the texts with a few changes; now and then the bytes as well."""
    text = rng.choice(texts)
    for _ in range(rng.choice([1, 1, 1, 2, 3, 8])):
        text = damage(text, rng, texts)
        if len(text) > 40_000:
            text = text[:40_000]
    data = text.encode("utf-8", "surrogatepass")
    if rng.random() < 0.05:
        for _ in range(rng.randrange(1, 4)):
            at = rng.randrange(len(data) + 1)
            data = data[:at] + rng.choice(NOISE) + data[at + rng.randrange(2) :]
    return Case(data)
