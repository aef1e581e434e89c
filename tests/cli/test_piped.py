"""A spec from standard input or a pipe, for every command that reads one; numbers as people type them."""

import io
import os
import sys

import pytest

TEXT = "object mug, plate\ntask: leftOf(mug, plate)\n"


@pytest.fixture
def piped(monkeypatch):
    """piped(text): what standard input has."""

    def put(text):
        monkeypatch.setattr(sys, "stdin", io.TextIOWrapper(io.BytesIO(text.encode())))

    return put


COMMANDS = [
    ("check", "-"),
    ("range", "-"),
    ("sample", "-", "-n", "2", "--out", "s.json"),
    ("sample", "-", "-n", "2", "--out", "s/"),
    ("eval", "-", "s.json"),
    ("pairs", "-", "-n", "2", "--out", "p.json"),
    ("grammar", "-"),
    ("dataset", "-", "-n", "2", "--out", "d/"),
    ("view", "-", "--export", "v.html", "-n", "2"),
]


@pytest.mark.long
@pytest.mark.parametrize("words", COMMANDS, ids=" ".join)
def test_standard_input_is_a_spec(words, scenegen, here, piped):
    (here / "two.spec").write_text(TEXT)
    assert scenegen("sample", "two.spec", "-n", "2", "--out", "s.json").status == 0
    piped(TEXT)
    outcome = scenegen(*(f"o{word}" if word in ("s.json", "s/") and "--out" in words else word for word in words))
    assert outcome.status == 0, outcome.err


def test_a_pipe_of_a_shell_is_a_spec(scenegen, here):
    read, write = os.pipe()
    os.write(write, TEXT.encode())
    os.close(write)
    outcome = scenegen("check", f"/dev/fd/{read}")
    os.close(read)
    assert outcome.status == 0 and outcome.out.startswith("<stdin>: ok\n")


def test_mistakes_and_imports_of_what_is_piped(scenegen, here, piped):
    piped("task: leftOf(mug, plate\n")
    outcome = scenegen("check", "-")
    assert outcome.status == 1 and " --> <stdin>:1:13" in outcome.err
    (here / "near.spec").write_text("const NEAR = 20 cm\n")
    piped('import "near.spec"\ntask: closeTo(mug, plate, NEAR)\n')
    assert scenegen("check", "-").status == 0  # from the current folder
    piped("")
    assert "<stdin> is empty" in scenegen("check", "-").err


@pytest.mark.parametrize(("text", "count"), [("1e1", 10), ("1_0", 10), ("1.5e1", 15), ("12", 12)])
def test_numbers_of_scenes(text, count, scenegen, here):
    import json

    (here / "two.spec").write_text(TEXT)
    assert scenegen("sample", "two.spec", "-n", text, "--out", "s.json").status == 0
    assert len(json.loads((here / "s.json").read_text())["scenes"]) == count


@pytest.mark.parametrize("text", ["1.5", "abc", "1e-3", "1e400", "nan", "inf", "0x10", ""])
def test_what_is_no_number_of_scenes(text, scenegen, here):
    (here / "two.spec").write_text(TEXT)
    outcome = scenegen("sample", "two.spec", "-n", text)
    assert outcome.status == 1 and "is not a whole number" in outcome.err


@pytest.mark.parametrize(
    ("fix", "pose"),
    [
        ("plate=50cm,0.5,90deg", (0.5, 0.5, 1.5707963267948966)),
        ("plate=0.5, 500 mm, 0.25 turn", (0.5, 0.5, 1.5707963267948966)),
        ("plate=0.5m,0.5,1rad", (0.5, 0.5, 1.0)),
        ("plate=0.5,0.5,1", (0.5, 0.5, 1.0)),
        ("plate=0.5,0.5,-90deg", (0.5, 0.5, 4.71238898038469)),
        ("plate=0.5,0.5,90\N{DEGREE SIGN}", (0.5, 0.5, 1.5707963267948966)),
    ],
)
def test_units_of_fixed_objects(fix, pose, scenegen, here):
    import json

    (here / "two.spec").write_text(TEXT)
    assert scenegen("sample", "two.spec", "-n", "1", "--fix", fix, "--out", "s.json").status == 0
    (scene,) = json.loads((here / "s.json").read_text())["scenes"]
    assert tuple(scene["poses"]["plate"].values()) == pytest.approx(pose, abs=1e-15)


@pytest.mark.parametrize(
    ("words", "same"),
    [
        (("--phi", "5cm:10cm"), ("--phi", "0.05:0.1")),
        (("--phi", "task=-50 mm:0.1m"), ("--phi", "-0.05:0.1")),
        (("--phi", "-10deg:"), ("--phi", "-0.17453292519943295:")),
        (("--seed", "1e3"), ("--seed", "1000")),
        (("--timeout", "2min"), ("--timeout", "120")),
        (("--timeout", "90 s"), ("--timeout", "90")),
        (("--workers", "1e0"), ("--workers", "1")),
    ],
    ids=lambda words: " ".join(words),
)
def test_values_as_people_type_them(words, same, scenegen, here):
    (here / "two.spec").write_text(TEXT)
    made = [scenegen("sample", "two.spec", "-n", "2", *given) for given in (words, same)]
    assert made[0].status == 0 and made[0].out == made[1].out


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (("sample", "two.spec", "--phi", "5kg:"), "or with units: 5cm:20cm"),
        (("sample", "two.spec", "--timeout", "1m"), "write seconds, 60, or a unit: 90s, 2min"),
        (("range", "two.spec", "--timeout", "1h"), "write seconds, 60, or a unit: 90s, 2min"),
        (("sample", "two.spec", "--seed", "one"), "write 1000, 1_000 or 1e3"),
        (("sample", "two.spec", "--fix", "mug=0.5,0.5,NORTH"), "90deg for NORTH"),
        (("sample", "two.spec", "--fix", "mug=0.5,0.5,west"), "180deg for west"),
        (("sample", "two.spec", "n", "16"), "an option begins with a dash: -n;"),
        (("check", "two.spec", "full"), "an option begins with a dash: --full;"),
        (("range", "two.spec", "seed", "3"), "an option begins with a dash: --seed"),
        (("pairs", "two.spec", "n"), "an option begins with a dash: -n"),
    ],
    ids=lambda words: " ".join(words) if isinstance(words, tuple) else "",
)
def test_the_right_spelling_is_named(words, said, scenegen, here):
    (here / "two.spec").write_text(TEXT)
    outcome = scenegen(*words)
    assert outcome.status in (1, 2) and outcome.err.count("error[") == 1 and said in outcome.err, outcome.err


@pytest.mark.parametrize(
    ("fix", "code"),
    [
        ("plate=0.5,0.5,90", "more-than-a-turn"),
        ("plate=0.5deg,0.5", "not-a-number"),
        ("plate=0.5,0.5,3cm", "not-a-number"),
        ("plate=0.5,0.5,north", "not-a-number"),
    ],
)
def test_wrong_units_of_fixed_objects(fix, code, scenegen, here):
    (here / "two.spec").write_text(TEXT)
    outcome = scenegen("sample", "two.spec", "-n", "1", "--fix", fix)
    assert outcome.status == 1 and f"error[{code}]" in outcome.err and "--fix:1:" in outcome.err
