"""Laws of the quantitative semantics, exactly, bit for bit, in the oracle's float64."""

from hypothesis import given, settings
from hypothesis import strategies as st

from scenegen.lang.checker import check_text
from scenegen.lang.formula.interpret import phi

from ..laws import examples
from .formulas import formulas, objects, scenes, seeds, spec_text

pairs = objects.flatmap(lambda names: st.tuples(st.just(names), formulas(names), formulas(names)))

# each line: two formulas over f and g that are worth the same everywhere
EQUAL = [
    ("!(f & g)", "!f | !g"),
    ("!(f | g)", "!f & !g"),
    ("!!f", "f"),
    ("f -> g", "!f | g"),
    ("f & g", "g & f"),
    ("f | g", "g | f"),
    ("f & f", "f"),
    ("f | f", "f"),
    ("f & (f | g)", "f"),
    ("f & true", "f"),
    ("f | false", "f"),
    ("!(f -> g)", "f & !g"),
]


@settings(max_examples=examples(40), deadline=None, derandomize=True)
@given(pairs, seeds)
def test_what_negation_and_the_connectives_do(pair, seed):
    names, f, g = pair
    labels = {"f": f, "g": g, "both": "f & g", "either": "f | g", "not_f": "!f"}
    for number, (left, right) in enumerate(EQUAL):
        labels[f"left{number}"], labels[f"right{number}"] = left, right
    anchor = f" & x({names[0]}) <= 99"  # keeps every label depending on the scene
    spec = check_text(spec_text(names, f=labels.pop("f") + anchor, g=labels.pop("g") + anchor, **labels))
    for column in scenes(len(names), 6, seed).T:
        worth = phi(spec.core, column.tolist())
        assert worth["not_f"] == -worth["f"]
        assert worth["both"] == min(worth["f"], worth["g"])
        assert worth["either"] == max(worth["f"], worth["g"])
        for number, law in enumerate(EQUAL):
            assert worth[f"left{number}"] == worth[f"right{number}"], law


@settings(max_examples=examples(25), deadline=None, derandomize=True)
@given(pairs, seeds)
def test_a_definition_and_a_label_are_worth_what_they_stand_for(pair, seed):
    names, f, _ = pair
    f = f"{f} & x({names[0]}) <= 99"
    named = spec_text(names) + f"def whole() = {f}\nplain: {f}\ncalled: whole()\nagain: plain\nminus: !whole()\n"
    spec = check_text(named)
    for column in scenes(len(names), 4, seed).T:
        worth = phi(spec.core, column.tolist())
        assert worth["plain"] == worth["called"] == worth["again"] == -worth["minus"]
