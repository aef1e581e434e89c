"""The names that tokens tell, against those that the syntax tree tells."""

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from scenegen.editors.lsp.document import Document
from scenegen.editors.lsp.names import index
from scenegen.errors import Source
from scenegen.lang.syntax import ast
from scenegen.lang.syntax import ast as traversal
from scenegen.lang.syntax.parse import parse
from scenegen.lang.syntax.printer import print_module
from scenegen.resources import shipped_specs

from ..lang import trees
from ..laws import examples


def told_by_the_tree(module):
    """(start, end) of every name that stands for a value, with the start of the local binding that it has, if any."""
    found = {}

    def walk(node, visible):
        match node:
            case ast.Name():
                start = module.source.text.index(node.id, node.start)  # parentheses belong to the node
                found[start, start + len(node.id)] = visible.get(node.id)
            case ast.Quantifier(_, variables, domain, body):
                walk(domain, visible)
                walk(body, visible | {one.id: one.start for one in variables})
            case _:
                for child in traversal.children(node):
                    walk(child, visible)

    for statement in module.statements:
        parameters = {}
        if isinstance(statement, ast.Definition):
            parameters = {one.name.id: one.name.start for one in statement.parameters}
        for expr in traversal.expressions(statement):
            is_body = isinstance(statement, ast.Definition) and expr is statement.body
            walk(expr, parameters if is_body else {})
    return found


def agree(text):
    source = Source("x.spec", text)
    module = parse(source)
    expected = told_by_the_tree(module)
    if module.bare is not None:
        return
    found = index(source)
    assert [one.start for one in found.statements] == [one.start for one in module.statements]
    values = {
        (one.start, one.end): one.local.start if one.local is not None else None
        for one in found.occurrences
        if one.role == "value"
    }
    assets = {(one.start, one.end) for one in found.occurrences if one.role == "asset"}
    assert values == {place: local for place, local in expected.items() if place not in assets}
    calls = {(one.start, one.name) for one in found.occurrences if one.role == "call"}
    assert calls == {(node.function.start, node.function.id) for node in nodes(module) if isinstance(node, ast.Call)}
    members = {(one.start, one.name) for one in found.occurrences if one.role == "member"}
    assert members == {(node.member.start, node.member.id) for node in nodes(module) if isinstance(node, ast.Member)}
    arguments = {(one.start, one.name) for one in found.occurrences if one.role == "argument"}
    assert arguments == {
        (node.name.start, node.name.id) for node in nodes(module) if isinstance(node, ast.Argument) and node.name
    }


def nodes(module):
    stack = [expr for statement in module.statements for expr in traversal.expressions(statement)]
    while stack:
        node = stack.pop()
        yield node
        stack.extend(traversal.children(node))


@settings(max_examples=examples(60), deadline=None, derandomize=True)
@given(st.lists(trees.statements, min_size=1, max_size=4))
def test_tokens_and_tree_agree(statements):
    agree(print_module(ast.Module(Source("", ""), tuple(statements), None)))


@pytest.mark.parametrize("name", sorted(shipped_specs()))
def test_of_the_shipped_specs(name):
    agree(shipped_specs()[name].read_text())


MANY = """object mug, block[3] = box(1, 1, 1), tray = urdf("t.urdf", box(1, 1, 1)) at (0.5, 0.5)
const N = 3
def f(p, q = N, r = dist((0, 0), (1, 1))) =
    (forall p in block: leftOf(p, q) & exists s, t in [p, mug]: leftOf(s, t)) & leftOf(p, s)
a: forall i in 1..N: f(p = block[i], q = mug) | (forall j in 1..i: leftOf(block[j], mug)) -> leftOf(block[j], i)
"""


def test_of_a_file_with_everything():
    agree(MANY)
    found = index(Source("x.spec", MANY))
    assert [(one.kind, one.name, one.is_array) for one in found.declarations] == [
        ("object", "mug", False),
        ("object", "block", True),
        ("object", "tray", False),
        ("constant", "N", False),
        ("definition", "f", False),
        ("label", "a", False),
    ]
    tray = found.declarations[2]
    assert MANY[tray.opens : tray.closes] == 'tray = urdf("t.urdf", box(1, 1, 1)) at (0.5, 0.5)'
    parameters = [one.local for one in found.occurrences if one.local and one.local.kind == "parameter"]
    assert [MANY[one.opens : one.closes] for one in parameters[:3]] == ["p", "q = N", "r = dist((0, 0), (1, 1))"]


def test_broken_texts_keep_their_names():
    text = "object mug, plate\nconst NEAR = = 3\ndef f(p = leftOf(p, mug\ntask: forall i in 1..3: leftOf(mug, i\nsafe: "
    found = index(Source("x.spec", text))
    assert [one.name for one in found.declarations] == ["mug", "plate", "NEAR", "f", "task", "safe"]
    (last,) = (one for one in found.occurrences if one.name == "i" and one.role == "value")
    assert last.local is not None and last.local.kind == "variable"


@pytest.mark.parametrize(
    "text", ["", "#", "\n\n", "object", "def", "def f", "def f(", ")", ":", "forall", "a.b.", "[("]
)
def test_scraps(text):
    document = Document(text)
    assert [one.start for one in document.index.statements] in ([], [0])
    assert document.values is not None and document.functions["leftOf"].source.name == "prelude.spec"
