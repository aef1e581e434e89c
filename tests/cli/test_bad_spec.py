"""Specs with a mistake, through the program: where it is, what it is, what to do."""

import pytest

TEXTS = {
    "unknown_relation": ("object mug, plate\ntask: nextTo(mug, plate)\n", "2:7"),
    "miscased_relation": ("object mug, plate\ntask: LeftOf(mug, plate)\n", "2:7"),
    "too_few_arguments": ("task: leftOf(mug)\n", "1:7"),
    "too_many_arguments": ("task: leftOf(mug, plate, cup)\n", "1:26"),
    "undeclared_object": ("object mug, plate\ntask: leftOf(mug, fork)\n", "2:19"),
    "missing_operator": ("task: leftOf(mug, plate) leftOf(plate, mug)\n", "1:26"),
    "never_closed": ("task: (leftOf(mug, plate) & leftOf(plate, mug)\n", "1:7"),
    "never_opened": ("task: leftOf(mug, plate))\n", "1:25"),
    "empty": ("", "1:1"),
    "only_comments": ("\n# a spec to be\n", "3:1"),
    "number_for_an_object": ("task: leftOf(mug, 3)\n", "1:19"),
    "object_for_a_number": ("object mug, plate, fork\ntask: closeTo(mug, plate, fork)\n", "2:27"),
    "wide_characters": ("# Tasse und Teller, schön gedeckt\n\ttask: leftOf(mug, plate) & nextTö(mug)\n", "2:34"),
}
BYTES = {
    "binary": bytes(range(256)),
    "not_utf8": "# café\ntask: leftOf(mug, plate)\n".encode("latin-1"),
}


@pytest.mark.parametrize("name", TEXTS)
def test_a_mistake_in_the_text(name, refused, here, golden):
    text, place = TEXTS[name]
    (here / "my.spec").write_text(text)
    said = refused("check", "my.spec")
    assert said.splitlines()[1].strip() == f"--> my.spec:{place}"
    golden(f"cli/errors/spec_{name}.txt", said)


@pytest.mark.parametrize("command", ["sample", "train", "eval"])
def test_every_command_reads_specs_alike(command, refused, here):
    (here / "my.spec").write_text(TEXTS["unknown_relation"][0])
    more = {"sample": ["--out", "o.json"], "train": ["--model", "gan", "--out", "m.st"], "eval": ["scenes.json"]}
    assert "--> my.spec:2:7" in refused(command, "my.spec", *more[command])


@pytest.mark.parametrize("name", BYTES)
def test_not_a_text(name, refused, here, golden):
    (here / "my.spec").write_bytes(BYTES[name])
    golden(f"cli/errors/spec_{name}.txt", refused("check", "my.spec"))


@pytest.mark.parametrize("name, path", [("missing", "godo.spec"), ("missing_alone", "x/y/z"), ("folder", "sub")])
def test_not_a_file(name, path, refused, here, golden):
    (here / "sub").mkdir()
    golden(f"cli/errors/spec_{name}.txt", refused("check", path))


def test_every_mistake_of_a_spec_is_told_in_the_order_of_the_text(scenegen, here, golden):
    (here / "my.spec").write_text("object mug\nlater: nextTo(mug, cup)\nsooner: leftOf(mug, mug, mug)\n")
    outcome = scenegen("check", "my.spec", "good.spec")
    assert outcome.status == 1
    assert outcome.err.count("error[") == 3
    assert outcome.out.startswith("\ngood.spec: ok") or outcome.out.startswith("good.spec: ok")
    golden("cli/errors/spec_three_mistakes.txt", outcome.err)
