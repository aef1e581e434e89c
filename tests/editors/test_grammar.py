"""The TextMate grammar of editors/vscode: its scopes, and that it says what grammar/spec.lark says."""

import json
import re

import pytest

from scenegen.errors import Source
from scenegen.lang.syntax.parse import parse_tolerant
from scenegen.lang.syntax.tokens import KEYWORDS, TEMPORAL, scan
from scenegen.resources import grammar_file, shipped_specs

from .textmate import Grammar, report


@pytest.fixture(scope="module")
def folder(request):
    return request.config.rootpath / "editors" / "vscode"


@pytest.fixture(scope="module")
def text(folder):
    return (folder / "syntaxes" / "scenegen.tmLanguage.json").read_text(encoding="utf-8")


@pytest.fixture(scope="module")
def grammar(text):
    return Grammar(json.loads(text))


@pytest.fixture(scope="module")
def everything(request):
    return (request.config.rootpath / "tests" / "editors" / "everything.spec").read_text(encoding="utf-8")


def scopes_of(grammar, text):
    """offset -> (text, innermost scope) of the tokens of a text."""
    found, offset = {}, 0
    for tokens, line in zip(grammar.tokenize(text), text.split("\n"), strict=True):
        assert "".join(one.text for one in tokens) == line
        for one in tokens:
            found[offset] = (one.text, one.scopes[-1] if one.scopes else "")
            offset += len(one.text)
        offset += 1
    return found


def test_scopes_of_everything(grammar, golden, everything):
    golden("editors/everything.txt", report(grammar.tokenize(everything)))


def test_everything_is_a_spec(everything):
    """As far as the parser is concerned: names are free there."""
    _, problems = parse_tolerant(Source("everything.spec", everything))
    assert problems == []


CLAUSES = {
    "category",
    "on",
    "any",
    "of",
    "by",
    "area",
    "camera",
    "robot",
    "looks",
    "fov",
    "usually",
}  # words of declarations that are names elsewhere


def test_every_token_has_the_scope_of_its_kind(grammar, everything):
    """Against the scanner of the language itself, on all texts that there are."""
    names = ("entity.", "variable.", "support.")
    kinds = {"text": "string.", "number": "constant.numeric", "name": names}
    texts = [everything, grammar_file("prelude.spec").read_text(encoding="utf-8")]
    texts += [path.read_text(encoding="utf-8") for path in shipped_specs().values()]
    for text in texts:
        found = scopes_of(grammar, text)
        for token in scan(text):
            scope = found.get(token.start, ("", ""))[1]
            if token.kind == "sign" or token.text in KEYWORDS or token.text in ("x", *CLAUSES):
                continue
            if token.kind == "comment":
                assert scope == "punctuation.definition.comment.scenegen"
            else:
                assert scope.startswith(kinds[token.kind]), token
        for token in scan(text):
            if token.text in KEYWORDS:
                scope = found[token.start][1]
                assert scope.startswith(("keyword.", "storage.", "constant.language", "variable.language")), token


def test_the_keywords_are_those_of_the_language(text):
    """Each keyword of grammar/spec.lark has a scope of its own, and no other word of the grammar is taken for one."""
    lark = grammar_file("spec.lark").read_text(encoding="utf-8")
    reserved = set(re.search(r"NAME: /\(\?!\(([a-z|]+)\)", lark)[1].split("|"))
    assert reserved == KEYWORDS
    tree = Grammar(json.loads(text))
    for word in reserved:
        sample = {"def": "def f(a)", "workspace": "workspace [0, 1]"}.get(word, f"{word} a")
        scope = scopes_of(tree, sample)[0][1]
        assert scope.startswith(("keyword.", "storage.", "constant.language")), word
        assert not scopes_of(tree, f"{word}_{word}")[0][1].startswith(("keyword.", "storage.")), word
    words = set(re.findall(r"[a-z]{2,}", " ".join(_patterns(json.loads(text))).replace(r"\b", " ")))
    units = {"mm", "cm", "rad", "deg", "turn", "ms", "min"}
    over_time = {*TEMPORAL, "with", "time", "steps", "every", "moves", "one", "all"} - {"until_with"}
    assert words - reserved - units == {"objects"} | CLAUSES | over_time


def test_scopes_over_time(grammar, golden, request):
    grammar_tests = request.config.rootpath / "tests" / "editors"
    text = (grammar_tests / "over_time.spec").read_text(encoding="utf-8")
    assert parse_tolerant(Source("over_time.spec", text))[1] == []
    golden("editors/over_time.txt", report(grammar.tokenize(text)))
    found = scopes_of(grammar, text)
    for token in scan(text, timed=True):
        if token.text in TEMPORAL:
            assert found[token.start][1] == "keyword.operator.temporal.scenegen", token


@pytest.mark.parametrize("word", sorted(TEMPORAL))
def test_words_of_time_are_names_where_they_are_used_as_such(word, grammar):
    for text in (f"leftOf({word}, mug)", f"a: {word}.left", f"object mug, {word}", f"object {word} at (0, 0)"):
        scope = next(scope for said, scope in scopes_of(grammar, text).values() if said == word)
        assert scope.startswith("variable."), (text, scope)


def test_operators_are_those_of_the_language(grammar):
    lark = grammar_file("spec.lark").read_text(encoding="utf-8")
    operators = set(re.findall(r"^(?:_IMPLIES|_OR|_AND|_NOT|COMPARE)[.0-9]*: (.*)$", lark, re.MULTILINE))
    for sign in {one for line in operators for one in re.findall(r'"([^"]+)"', line)}:
        scope = scopes_of(grammar, f"a {sign} b")[2]
        assert scope[0] == sign and scope[1].startswith("keyword.operator."), sign


def test_relations_are_not_named(text):
    """A new relation of the prelude needs no change here."""
    prelude = grammar_file("prelude.spec").read_text(encoding="utf-8")
    patterns = " ".join(_patterns(json.loads(text))).replace(r"\b", " ")
    for name in set(re.findall(r"^(?:def|const) (\w+)", prelude, re.MULTILINE)) - {"on"}:  # a clause of objects too
        assert not re.search(rf"\b{name}\b", patterns)
    first = scopes_of(Grammar(json.loads(text)), "brandNew(a, b)")[0]
    assert first == ("brandNew", "entity.name.function.call.scenegen")


BROKEN = [
    "a: forall i in 1..3\nobject mug\nb: leftOf(mug, mug)",
    "def f(a, b\nobject mug\nb: leftOf(mug, mug)",
    "a: (((\nobject mug\nb: leftOf(mug, mug)",
    'import "never closed\nobject mug\nb: leftOf(mug, mug)',
    "object mug = box(\nobject mug\nb: leftOf(mug, mug)",
    "a: forall\nobject mug\nb: leftOf(mug, mug)",
]


@pytest.mark.parametrize("broken", BROKEN)
def test_an_unfinished_statement_does_not_colour_the_next(broken, grammar):
    alone = report(grammar.tokenize("object mug\nb: leftOf(mug, mug)"))
    after = report(grammar.tokenize(broken)).splitlines()[-len(alone.splitlines()) :]
    assert [line[3:] for line in after] == [line[3:] for line in alone.splitlines()]


def test_only_what_both_engines_read_alike(text):
    """Python's `re` stands in for Oniguruma: nothing that one of them lacks, or reads in another way."""
    for pattern in _patterns(json.loads(text)):
        re.compile(pattern)
        assert not re.search(r"\(\?P|\(\?>|\\[hHRXKGAzZpPQ]|[*+?}][+]|\[\[:|\(\?\(|&&", pattern), pattern


def test_the_extension_is_whole(folder):
    package = json.loads((folder / "package.json").read_text())
    (language,) = package["contributes"]["languages"]
    (grammar,) = package["contributes"]["grammars"]
    assert language["extensions"] == [".spec"] and grammar["language"] == language["id"] == "scenegen"
    scope = json.loads((folder / grammar["path"]).read_text(encoding="utf-8"))["scopeName"]
    assert scope == grammar["scopeName"] == "source.scenegen"
    configuration = json.loads((folder / language["configuration"]).read_text())
    assert configuration["comments"] == {"lineComment": "#"}
    assert "main" not in package and "dependencies" not in package, "no build step, no modules"
    for rule in configuration["indentationRules"].values():
        re.compile(rule)


def _patterns(rule):
    for key, value in rule.items() if isinstance(rule, dict) else ():
        if key in ("match", "begin", "end"):
            yield value
        yield from _patterns(value)
    for value in rule if isinstance(rule, list) else ():
        yield from _patterns(value)
