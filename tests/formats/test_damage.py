"""Two thousand damaged scenes files: each is read, or answered with one diagnostic, and nothing else happens."""

import random

import pytest

from scenegen.api.scenes import from_file
from scenegen.errors import ScenegenError
from scenegen.scenes.formats.scenes_json import load

MUTATIONS = 2000
JUNK = [
    b"",
    b"null",
    b"-1",
    b"1e999",
    b"NaN",
    b'"x"',
    b"[]",
    b"{}",
    b"\xff",
    b"\\u0000",
    b'"\\ud800"',
    b"1" * 5000,
    b",",
]


def mutated(data, source):
    data = bytearray(data)
    for _ in range(source.randint(1, 3)):
        place = source.randrange(len(data))
        match source.randrange(5):
            case 0:
                data[place] ^= 1 << source.randrange(8)
            case 1:
                del data[place : place + source.randint(1, 40)]
            case 2:
                data[place : place + source.randint(0, 6)] = source.choice(JUNK)
            case 3:
                end = min(len(data), place + source.randint(1, 200))
                data[place:place] = data[place:end]
            case 4:
                _swap_values(data, source)
    return bytes(data) or b"x"


def _swap_values(data, source):
    """A value where another kind of value belongs: what byte noise seldom gets right."""
    starts = [index + 2 for index in range(len(data) - 3) if data[index : index + 2] == b": "]
    if starts:
        start = source.choice(starts)
        end = start
        while end < len(data) and data[end] not in b",}\n":
            end += 1
        data[start:end] = source.choice(JUNK)


def test_nothing_but_a_diagnostic(written):
    source = random.Random(2026)
    read = refused = 0
    for _ in range(MUTATIONS):
        data = mutated(written, source)
        try:
            from_file(load(data, "x.json"))
        except ScenegenError as error:
            assert len(error.diagnostics) == 1 and error.diagnostics[0].help, data
            refused += 1
        else:
            read += 1
    assert refused > MUTATIONS // 2 and read > 20


@pytest.mark.parametrize("keep", [0.1, 0.5, 0.9, 0.999])
def test_truncated(written, keep):
    with pytest.raises(ScenegenError, match="not valid JSON"):
        load(written[: int(len(written) * keep)], "x.json")
