"""Random numbers of things: what a spec with them means, and what is wrong with one."""

import pytest

import scenegen
from scenegen.errors import RequestError, SpecError

FAMILY = "object block[2..4], cup[1..2], mug\nrequire noOverlap(objects)\ntask: forall b in block: leftOf(b, mug)\n"


def test_a_family_has_an_ordinary_spec_for_each_combination():
    spec = scenegen.parse(FAMILY)
    assert spec.counts == {"block": (2, 4), "cup": (1, 2)}
    assert [tuple(numbers.values()) for numbers, _ in spec.members] == [(2, 1), (2, 2), (3, 1), (3, 2), (4, 1), (4, 2)]
    for numbers, member in spec.members:
        plain = scenegen.parse(FAMILY.replace("2..4", str(numbers["block"])).replace("1..2", str(numbers["cup"])))
        assert member.source == plain.source and member.objects == plain.objects
        mine, theirs = member.checked.core, plain.checked.core
        assert (mine.objects, mine.labels, mine.requirement) == (theirs.objects, theirs.labels, theirs.requirement)
        assert len(mine.nodes) == len(theirs.nodes)  # which say where they stand in the text
    assert spec.objects == member.objects, "all that there can be"
    assert spec.bounds() == {"task": (-1.0, 1.0)}


def test_what_is_printed_is_read_again():
    spec = scenegen.parse(
        "const N = 3 object block[N - 1..N+1] = box(4 cm, 4 cm, 4 cm), mug task: leftOf(mug, block[1])"
    )
    assert "block[N - 1..N + 1]" in spec.source
    again = scenegen.parse(spec.source)
    assert again.source == spec.source and again.counts == spec.counts == {"block": (2, 4)}


def test_a_number_is_fixed_and_the_others_are_drawn():
    spec = scenegen.parse("# Blocks\n" + FAMILY)
    some = spec.with_counts({"block": 3})
    assert some.counts == {"cup": (1, 2)} and "block[3], cup[1..2]" in some.source
    assert some.declared.title == "Blocks"
    assert not some.with_counts({"cup": 1}).counts and spec.with_counts({}) is spec
    for counts, code in (
        ({"blok": 3}, "unknown-count"), ({"block": 5}, "count-out-of-range"), ({"mug": 1}, "unknown-count"),
        ({"block": 2.5}, "wrong-value"), ([3], "wrong-value"),
    ):  # fmt: skip
        with pytest.raises(RequestError) as error:
            spec.with_counts(counts)
        assert error.value.diagnostics[0].code == code


def test_what_knows_nothing_of_families_refuses_them():
    with pytest.raises(RequestError, match="draws how many things there are"):
        _ = scenegen.parse(FAMILY).checked


@pytest.mark.parametrize(
    ("text", "code", "said"),
    [
        ("object b[3..2], m task: leftOf(m, b[1])", "empty-range", "3..2"),
        ("object b[0..2], m task: leftOf(m, b[1])", "empty-array", "0 elements"),
        ("object b[-1..2], m task: leftOf(m, b[1])", "empty-array", "-1"),
        ("object b[1.5..3], m task: leftOf(m, b[1])", "not-a-whole-number", "1.5"),
        ("object b[2..3 cm], m task: leftOf(m, b[1])", "wrong-unit", "a length"),
        ("object b[1..m], m task: leftOf(m, b[1])", "wrong-name", "`m`"),
        ("object b[1..1000000000], m task: leftOf(m, b[1])", "too-many-objects", "20,000"),
        ("object b[1..2e300], m task: leftOf(m, b[1])", "too-many-objects", "20,000"),
        ("object b[1..65], m task: leftOf(m, b[1])", "too-many-counts", "65 combinations"),
        ("object a[1..9], b[1..9] task: leftOf(a[1], b[1])", "too-many-counts", "81 combinations"),
        ("object b[2..4], m task: leftOf(m, b[3])", "may-be-missing", "`b[3]` may be missing"),
        ("object b[2..4], m task: leftOf(m, b[5])", "index-out-of-range", "5 of 4"),
        ("object b[2..4], m task: forall i in 1..4: leftOf(b[i], m)", "may-be-missing", "`b[3]`"),
        ("object b[2..4] def f(c) = leftOf(c[1], c[3]) task: f(b)", "index-out-of-range", "with b[2]"),
        ("object b[1..3], m task: forall p, q in b: leftOf(p, q)", "too-few-elements", "with b[1]"),
        ("object b[1..2] at [(0.1, 0.1), (0.2, 0.2)], m task: leftOf(m, b[1])", "wrong-number-of-places", "b[1]"),
        ("object b[1..2] = box(b.count * 5 cm, 1 cm, 1 cm), m task: leftOf(m, b[1])", "depends-on-number", "shape"),
        ("object b[1..2], m region r = rect(0, 0, b.count * 0.1, 1) task: inside(m, r)", "depends-on-number", "region"),
        ("object b[1..2], m at (b.count * 0.1, 0) task: leftOf(m, b[1])", "depends-on-number", "place of `m`"),
        ("region r[1..2] = rect(0, 0, 1, 1) at 3 cm object a, b task: leftOf(a, b)", "level-count", "levels"),
        ("time 5 steps object b[1..2], a task: always leftOf(b[1], a)", "no-place-over-time", "over time"),
        ("object b[2..], m task: leftOf(m, b[1])", "unexpected", "`]`"),
    ],
)  # fmt: skip
def test_a_mistake_gets_a_diagnostic(text, code, said):
    with pytest.raises(SpecError) as error:
        scenegen.parse(text)
    (one,) = error.value.diagnostics
    assert one.code == code
    assert said in "\n".join([one.title, one.label, one.help, one.note])


def test_a_range_of_one_number_draws_nothing():
    spec = scenegen.parse("object b[3..3], m task: leftOf(m, b[3])")
    assert [one.code for one in spec.warnings] == ["one-number"]
    assert not spec.counts and spec.source == "object b[3], m\ntask: leftOf(m, b[3])\n"


def test_the_last_of_them_is_another_one_with_another_number():
    spec = scenegen.parse("object b[1..2], m task: leftOf(b.last, m) & x(m) >= b.count * 0.1")
    texts = [member.checked.core.objects for _, member in spec.members]
    assert texts == [("b[1]", "m"), ("b[1]", "b[2]", "m")]


def test_editors_say_how_many_there_can_be():
    from scenegen.editors.lsp.document import Document
    from scenegen.editors.lsp.hover import hover

    found = hover(Document(FAMILY), FAMILY.index("block"))
    assert found is not None and "2 to 4 of block" in found.markdown


@pytest.mark.long
def test_a_grammar_names_what_is_always_there():
    text = scenegen.grammar_of(scenegen.parse("object block[2..3], mug task: leftOf(mug, block[1])"), "gbnf")
    assert "block[2..3], mug" in text and "block[2]" in text and "block[3]" not in text
