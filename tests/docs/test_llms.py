"""docs/llms.txt, the reference for prompts, is what docs/make_llms.py makes, and its examples check."""

import re
import runpy
from pathlib import Path

from scenegen.lang.checker import check_text

ROOT = Path(__file__).resolve().parents[2]


PAGE = ROOT / "docs" / "llms.txt"


def test_the_page_is_up_to_date(derived):
    made = runpy.run_path(str(ROOT / "docs" / "make_llms.py"))
    derived("docs/llms.txt", made["page"]())


def test_its_examples_check():
    text = PAGE.read_text(encoding="utf-8")
    examples = re.findall(r"^```spec\n(.*?)^```$", text, re.MULTILINE | re.DOTALL)
    assert len(examples) == 2
    for example in examples:
        assert not check_text(example).warnings


def test_it_names_all_there_is():
    from scenegen.lang.check.scope import STEPS, prelude, signatures
    from scenegen.lang.syntax import ast

    text = PAGE.read_text(encoding="utf-8")
    names = [one.name.id for one in prelude().statements if isinstance(one, ast.Definition | ast.Constant)]
    known = [*names, *signatures(), *STEPS]
    assert [name for name in known if not re.search(rf"\b{name}\b", text)] == []
