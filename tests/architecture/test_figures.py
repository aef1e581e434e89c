"""The architecture gets no worse. That lines and files become more never fails."""

import ast

import pytest

from tests.architecture import measure


@pytest.mark.long
def test_no_figure_gets_worse_than_recorded():
    before = measure.recorded()
    assert before.keys() == measure.ADVICE.keys()
    found = measure.places()
    worse = [
        f"{name}: {len(found[name])} instead of {before[name]}; {measure.ADVICE[name]}.\n"
        f"    `python -m tests.architecture.measure '{name}'` lists them"
        for name in before
        if len(found[name]) > before[name]
    ]
    assert not worse, "\n".join([*worse, "If it has to be so, record it with --accept, and say why in the commit."])


@pytest.mark.parametrize(
    ("rule", "text", "found"),
    [
        (measure.participles, "def told(): pass\nclass A:\n    def _reached(self): pass\n    def at(self): pass", 3),
        (measure.participles, "def tell(): pass\ndef seed(): pass\ndef made_of(): pass\ndef bed(): pass", 0),
        (
            measure.forms_of_phi,
            "Ends = tuple[float, float]\nPhi: type = Ends\nclass PhiBox: pass\nclass Range: pass",
            4,
        ),
        (measure.forms_of_phi, "class PhiSummary: pass\nclass Arrange: pass\nends = 3", 0),
        (measure.checks_again, "check_text(a.header.spec.source, 'x')\nspec = language.parse(spec.source)", 2),
        (measure.checks_again, "check_text(text)\nparse(source)\ncheck_text()", 0),
        (measure.doubled_classes, "class A: pass\nclass B:\n    class A: pass", 1),
    ],
)
def test_a_rule(rule, text, found):
    assert len(rule({measure.PACKAGE / "play" / "some.py": ast.parse(text)})) == found


def test_constants_of_one_name_are_ambiguous_where_their_values_differ():
    folder = measure.PACKAGE / "play"
    same = {folder / f"{name}.py": ast.parse("MOST = 3\nlower = 4") for name in "ab"}
    assert measure.ambiguous_constants(same) == []
    (line,) = measure.ambiguous_constants({**same, folder / "c.py": ast.parse("lower = 3\nMOST: int = 4")})
    assert line.split()[0] == "MOST" and line.count(".py") == 3
    asked = {folder / f"{name}.py": ast.parse(f"ENDING = '.{name}'") for name in "ab"}  # of every export format
    assert measure.ambiguous_constants(asked) == []
