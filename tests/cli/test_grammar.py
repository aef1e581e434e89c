"""`scenegen grammar`: its answers to bad requests, each one diagnostic, and the file that it writes."""

import re

import pytest

BAD = {
    "dialect": ["good.spec", "--to", "bnf"],
    "shape": ["good.spec", "--shape", "all"],
    "part": ["good.spec", "--only", "task"],
    "no_objects": ["--to", "gbnf"],
    "empty": ["--objects", ""],
    "twice": ["--objects", "mug,mug"],
    "a_keyword": ["--objects", "forall"],
    "too_many": ["--objects", "mug[41]"],
    "both": ["good.spec", "--objects", "mug"],
    "broken": ["broken.spec"],
    "not_there": ["nowhere.spec"],
    "impossible": ["impossible.spec"],
}


@pytest.mark.parametrize("name", BAD)
def test_one_diagnostic_each(name, refused, here):
    (here / "broken.spec").write_text("object mug\ntask: leftOf(mug,\n")
    text = "require closeTo(mug, plate, 5 cm) & x(mug) >= x(plate) + 10 cm\ntask: leftOf(mug, plate)\n"
    (here / "impossible.spec").write_text(text)
    assert len(re.findall(r"^error\[", refused("grammar", *BAD[name]), re.MULTILINE)) == 1


def test_a_name_that_is_none(scenegen):
    outcome = scenegen("grammar", "--objects", "9mug,plate")
    assert (outcome.status, outcome.out) == (1, "") and outcome.err.startswith("error[unexpected]: unexpected `9`")
    assert outcome.err.count("error[") == 1


@pytest.mark.long
def test_a_file_and_standard_output_are_the_same(scenegen, here):
    printed = scenegen("grammar", "--objects", "mug", "--to", "gbnf", "--only", "labels")
    written = scenegen("grammar", "--objects", "mug", "--to", "gbnf", "--only", "labels", "--out", "m.gbnf")
    assert (printed.status, written.status, written.out) == (0, 0, "")
    assert (here / "m.gbnf").read_text() == printed.out and printed.out.startswith("root ::= goal1\n")
