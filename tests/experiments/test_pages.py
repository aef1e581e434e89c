"""Pages: text by hand around tables that are filled in; those in docs/experiments hold what their JSON files say."""

import pytest

from experiments.page import block, fill, names
from tests.experiments.pages import MAKERS, tables_of


def test_filling_keeps_the_text():
    page = f"# Title\n\nBefore.\n\n{block('one', 'old')}\n\nBetween.\n\n{block('gone', 'left')}\n"
    filled, stale = fill(page, {"one": "new | 1", "two": "more"})
    assert filled == (
        f"# Title\n\nBefore.\n\n{block('one', 'new | 1')}\n\nBetween.\n\n{block('gone', 'left')}\n\n"
        f"## two\n\n{block('two', 'more')}\n"
    )
    assert stale == ["gone"] and names(filled) == ["one", "gone", "two"]
    assert fill(filled, {"one": "new | 1", "two": "more"})[0] == filled


def test_what_looks_like_a_group_of_a_pattern_is_text():
    assert r"\1 \g<name>" in fill(block("one", ""), {"one": r"\1 \g<name>"})[0]


@pytest.mark.parametrize("name", MAKERS)
def test_the_tables_in_docs_are_those_of_the_data(name, root, request):
    path = root / "docs" / "experiments" / f"{name}.md"
    page, tables = path.read_text(encoding="utf-8"), tables_of(path.with_suffix(".json"))
    filled, _ = fill(page, tables)
    if request.config.getoption("--regenerate"):
        path.write_text(filled, encoding="utf-8")
        return
    assert set(tables) <= set(names(page)) and filled == page
