"""A file of 100 kB: seconds of this process, so that a busy machine does not decide."""

import time

from scenegen.lsp.complete import complete
from scenegen.lsp.define import definition, symbols, uses
from scenegen.lsp.diagnose import problems
from scenegen.lsp.document import Document
from scenegen.lsp.hover import hover


def seconds(function, *arguments):
    began = time.process_time()
    function(*arguments)
    return time.process_time() - began


def test_a_long_file():
    formula = "leftOf(mug, plate) & !closeTo(mug, plate, 0.{}) | angle(mug, NORTH, 0.2)"
    text = "object mug, plate\n" + "".join(f"l{k}: {formula.format(k + 1)}\n" for k in range(1300))
    assert len(text) > 100_000
    document = Document(text)
    place = text.rindex("leftOf")
    for feature in (complete, definition, uses):
        assert seconds(feature, document, place) < 4.0, feature.__name__
    assert seconds(symbols, document) < 4.0
    # the checker's own time is its room's business; here only that nothing beside it counts
    assert seconds(problems, document) < 12.0
    assert seconds(hover, document, place) < 4.0
