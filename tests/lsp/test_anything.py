"""No text and no place in it makes a feature fail."""

from hypothesis import given, settings
from hypothesis import strategies as st

from scenegen.editors.lsp.answers import definition, formatted, problems, refusal, symbols, uses
from scenegen.editors.lsp.completion import completions
from scenegen.editors.lsp.document import Document
from scenegen.editors.lsp.hover import hover

from ..laws import examples

SEED = """workspace [0, 2] x [0, 1]
object plate, mug = cup, tray at (0.5, 0.5, 90 deg), block[3] = box(5 cm, 6 cm, 7 cm)
region mat = rect(0.2, 0, 0.8, y(workspace.top) / 5) # mat
const NEAR = 25 cm
import "no.spec"
def f(p, e = NEAR) = closeTo(p, mat.left, e) -> !leftOf(p, [mug, plate].first)
require leftOf(tray, mug)
t: f(plate, e = 1 / 2) & -x(mug) <= -NEAR <= 3 | f(plate)
u: (forall i in 1..2: leftOf(block[i], block[i + 1])) & t
v: exists p, q in consecutive(block): min(x(p), x(q)) <= 0.5
"""
pieces = st.sampled_from(
    [*'()[],:.=&|!§#"\n ', "forall ", "def ", "x", "1..", "25 cm", "mug", "object ", "a: ", "∀", "\r", "\0"]
)


@settings(max_examples=examples(25), deadline=None, derandomize=True)
@given(
    st.integers(0, len(SEED)),
    st.integers(0, 60),
    st.lists(pieces, max_size=4),
    st.integers(0, len(SEED)),
    st.booleans(),
)
def test_mutations(at, cut, new, cursor, near):
    text = SEED[:at] + "".join(new) + SEED[at + cut :]
    document = Document(text)
    offset = min(at + len("".join(new)) if near else cursor, len(document.text))
    for item in completions(document, offset):
        assert 0 <= item.start <= item.end <= len(document.text)
    for found in (hover(document, offset), *symbols(document), *uses(document, offset), *problems(document)):
        assert found is None or 0 <= found.start <= found.end <= len(document.text)
    definition(document, offset)
    refusal(document, offset, "fresh")
    formatted(document)


def test_every_place_of_a_good_text():
    document = Document(SEED.replace('import "no.spec"\n', ""))
    assert [one.severity for one in problems(document)] == []
    for offset in range(0, len(document.text) + 1, 9):
        hover(document, offset)
        completions(document, offset)
        definition(document, offset)
