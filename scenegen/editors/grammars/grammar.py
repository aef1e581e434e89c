"""Grammars of what a language model may say about a spec."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any

from scenegen.api.spec import Spec, parse
from scenegen.editors.grammars.rules import Grammar
from scenegen.errors import RequestError, Source
from scenegen.errors.requests import NO_VALID_SCENE, OUT_OF_RANGE, UNKNOWN_CHOICE

WRITERS = ("lark", "gbnf", "json")
SHAPES = ("goals", "formulas")
PARTS = ("spec", "labels")
MOST_OBJECTS = 40  # the time it takes grows with their square: a minute for 40


def grammar_of(about: Spec | Sequence[str], to: str = "lark", *, shape: str = "goals", only: str = "spec") -> str:
    """A context-free grammar of specs about the declarations of a spec, or about objects by name.

    `to`: "lark" (the dialect of llguidance), "json" (its JSON form) or "gbnf" (llama.cpp). With the shape "goals" each
    label is a statement that some scene satisfies, or a choice of a few: all that the grammar makes passes `scenegen
    check`. With "formulas" statements are joined freely; that may contradict itself, which `check` then says. `only` =
    "labels" leaves the declarations out of what the model writes. docs/language-models.md says more.

    Raises RequestError for an unknown choice, for more than 40 objects, and where no scene was found that meets what
    the spec requires; SpecError for names that cannot be objects.
    """
    _one_of("dialect", to, WRITERS)
    grammar = rules_of(about, shape=shape, only=only)
    return _writers()[to](grammar)


def rules_of(about: Spec | Sequence[str], *, shape: str = "goals", only: str = "spec") -> Grammar:
    """The rules that `grammar_of` writes, as data. Raises what it raises."""
    from scenegen.editors.grammars.goals import GOALS, grammar
    from scenegen.editors.grammars.scenes import declarations, label_names, valid_scenes
    from scenegen.editors.grammars.trial import findings

    _one_of("shape", shape, SHAPES)
    _one_of("part", only, PARTS)
    spec = about if isinstance(about, Spec) else of_objects(about)
    if len(spec.objects) > MOST_OBJECTS:
        wanted = f"at most {MOST_OBJECTS} objects: a grammar names every pair"
        raise RequestError(OUT_OF_RANGE(argument="objects", value=len(spec.objects), wanted=wanted))
    text = spec.source
    _, least = next(iter(spec.members))  # names what is there whatever the number of things
    scenes = valid_scenes(least.declared)
    if scenes is None:
        raise RequestError(NO_VALID_SCENE(file=spec.declared.name))
    found = findings(Source(spec.declared.name, least.source), scenes)
    declared = declarations(text, spec.objects)
    chosen: Any = shape
    return grammar(found, declared if only == "spec" else "", label_names(text, GOALS), chosen)


def of_objects(names: Sequence[str]) -> Spec:
    """A spec that declares the objects, written as in an `object` statement, and says nothing of them that matters.
    Raises SpecError for what is no object."""
    from scenegen.lang.syntax import ast
    from scenegen.lang.syntax.parse import parse as read

    declared = f"object {', '.join(names)}"
    (statement,) = read(Source("<objects>", declared)).statements
    assert isinstance(statement, ast.Objects)
    first = statement.declarations[0]
    one = first.name.id if first.count is None else f"{first.name.id}[1]"
    return parse(f"{declared}\ngoal: x({one}) >= 0\n", "<objects>")


def _writers() -> Mapping[str, Callable[[Grammar], str]]:
    from scenegen.editors.grammars.rules import gbnf, json, lark

    return {"lark": lark, "gbnf": gbnf, "json": json}


def _one_of(what: str, value: object, known: tuple[str, ...]) -> None:
    if value not in known:
        raise RequestError(UNKNOWN_CHOICE(what=what, name=value, known=known))
