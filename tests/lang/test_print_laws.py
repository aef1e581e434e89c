"""Laws of the canonical print over random trees: parsing it gives the tree back, printing that the same text."""

from hypothesis import given, settings

from scenegen.errors import Source
from scenegen.lang.syntax import ast
from scenegen.lang.syntax.parse import parse
from scenegen.lang.syntax.printer import format_source, print_module

from ..laws import examples
from .trees import dump, expressions, horizons, ladders, statements, timed_statements, tuples

NOWHERE = Source("", "")


def there_and_back(module):
    printed = print_module(module)
    parsed = parse(Source("printed.spec", printed))
    assert dump(parsed) == dump(module), printed
    assert (parsed.bare, parsed.statements) == (module.bare, module.statements)
    assert print_module(parsed) == printed


@settings(max_examples=examples(300), deadline=None, derandomize=True)
@given(expressions)
def test_a_formula(tree):
    there_and_back(ast.Module(NOWHERE, (), tree))


@settings(max_examples=examples(300), deadline=None, derandomize=True)
@given(ladders)
def test_the_ladder(tree):
    there_and_back(ast.Module(NOWHERE, (), tree))


@settings(max_examples=examples(150), deadline=None, derandomize=True)
@given(tuples(statements, least=1, most=5))
def test_statements(trees):
    there_and_back(ast.Module(NOWHERE, trees, None))


@settings(max_examples=examples(300), deadline=None, derandomize=True)
@given(horizons, tuples(timed_statements, most=4))
def test_over_time(horizon, trees):
    there_and_back(ast.Module(NOWHERE, (horizon, *trees), None))
    text = Source("a.spec", print_module(ast.Module(NOWHERE, (horizon, *trees), None)))
    formatted = format_source(text)
    assert format_source(Source("a.spec", formatted)) == formatted
