"""Completion: what can follow at the cursor, from the tokens before it, because the text there is unfinished."""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass
from itertools import pairwise
from typing import Literal

from scenegen.editors.lsp import names as vocabulary
from scenegen.editors.lsp.document import Document
from scenegen.editors.lsp.hover import asset
from scenegen.editors.lsp.names import Binding, Kind, StatementSpan
from scenegen.lang.check.heights import LIST_MEMBERS, SURFACE_SIZES
from scenegen.lang.check.names import AREAS, SHAPE_WORDS
from scenegen.lang.check.priors import TABLE_ENDING
from scenegen.lang.check.scope import BUILT_IN
from scenegen.lang.check.values import CORNERS, MEMBERS, SIDES, SIZES
from scenegen.lang.syntax.tokens import KEYWORDS, ROBOT, STATEMENTS, Token, scan
from scenegen.things import ASSETS, shape_of
from scenegen.things.arms import shipped_arms
from scenegen.things.surfaces import surfaces_of

Group = Literal["keyword", "function", "member", "unit", "asset", "argument", "file"] | Kind


@dataclass(frozen=True, slots=True)
class CompletionItem:
    """A word that can take the place of characters `start` to `end`; `detail` is its usage, `about` its meaning."""

    word: str
    group: Group
    detail: str
    about: str
    start: int
    end: int


@dataclass(frozen=True, slots=True)
class _WordAtCursor:
    """The word being written at start..end, and the tokens of its statement before it."""

    document: Document
    statement: StatementSpan | None
    before: tuple[Token, ...]
    start: int
    end: int

    def back(self, steps: int) -> str:
        """The text of the token so many steps before the word, "" if there is none."""
        return self.before[-steps].text if len(self.before) >= steps else ""

    def item(self, word: str, group: Group, detail: str = "", about: str = "") -> CompletionItem:
        return CompletionItem(word, group, detail, about, self.start, self.end)


def completions(document: Document, offset: int) -> list[CompletionItem]:
    """The words that fit at an offset, the most local ones first; none inside comments."""
    line = document.text.rfind("\n", 0, offset) + 1
    written = list(scan(document.text[line:offset]))
    if written and written[-1].kind == "comment":
        return []
    if document.text[line:offset].count('"') % 2:
        return list(_files(document, offset))
    here = _word_at(document, offset)
    return list(_items(here)) if here is not None else []


def _word_at(document: Document, offset: int) -> _WordAtCursor | None:
    text = document.text
    start = offset
    while start > 0 and (text[start - 1].isalnum() or text[start - 1] == "_") and text[start - 1].isascii():
        start -= 1
    statement = document.index.statement(start - 1) if start else None
    before = tuple(one for one in statement.tokens if one.start < start) if statement is not None else ()
    if text[start:offset][:1].isdigit():
        written = text[start:offset]
        digits = len(written.rstrip("acdegmnrtu"))
        if not written[:digits].isdigit():
            return None
        token = Token("number", written[:digits], start, start + digits, False, False)
        return _WordAtCursor(document, statement, (*before, token), start + digits, offset)
    if before and before[-1].kind == "number" and before[-1].end > start:  # `25 c|` with a unit already in it
        number = before[-1]._replace(text=before[-1].text.rstrip("acdegmnrtu").rstrip())
        before = (*before[:-1], number._replace(end=number.start + len(number.text)))
    return _WordAtCursor(document, statement, before, start, offset)


def _items(here: _WordAtCursor) -> Iterator[CompletionItem]:
    last = here.before[-1] if here.before else None
    kind = here.statement.kind if here.statement is not None and here.before else ""
    if last is not None and last.text == ".":
        yield from _members(here)
    elif _names_things(here):
        yield from _things(here)
    elif last is not None and last.kind == "number":
        if not last.text[-1:].isalpha() and here.document.text[last.end : here.start].strip(" \t") == "":
            yield from (here.item(unit, "unit", about=words) for unit, words in vocabulary.UNIT_TEXTS.items())
        yield from _after_operand(here, kind)
    elif kind == "object" and _opens_support(here):
        yield from _supports(here)
    elif kind == "object" and here.back(1) == "of" and len(here.before) > 2 and _depth(here.before) == 0:
        yield from _functions(here, ("category",))
    elif kind == "usually" and (here.back(2), here.back(1)) == ("uniform", "(") and here.before[1].text != "theta":
        yield from _regions(here)
    elif last is None or _can_end(last):
        yield from _after_operand(here, kind)
        if last is None and len(here.document.index.statements) <= 1:
            yield from _operands(here, "formula")
    elif last.text == "object" or (
        here.before[0].text != ROBOT and kind == "object" and last.text == "," and _depth(here.before) == 0
    ):
        yield from _assets(here)
    elif kind == "object" and last.text == "=" and here.before[0].text == ROBOT and _depth(here.before) == 0:
        yield from (here.item(name, "asset", about="an arm that comes along") for name in shipped_arms())
        yield from _functions(here, ("arm",))
    elif kind == "object" and last.text == "=" and _depth(here.before) == 0:
        yield from _assets(here)
        yield from _functions(here, SHAPE_WORDS)
    elif kind == "usually" and (last.text == "~" or (last.text in ("[", ",") and _lists_distributions(here.before))):
        for name, about in vocabulary.DISTRIBUTION_TEXTS.items():
            yield here.item(name, "keyword", about=about)
    elif kind == "region" and last.text == "=":
        yield from _functions(here, AREAS)
    elif last.text not in ("region", "const", "def", "import", "forall", "exists") and not _in_header(here, kind):
        yield from _operands(here, kind)


def _can_end(token: Token) -> bool:
    """Whether a formula may end with a token."""
    if token.kind == "name":
        return token.text not in KEYWORDS or token.text in ("true", "false", "workspace")
    return token.kind in ("number", "text") or token.text in (")", "]", "⊤", "⊥")


def _depth(tokens: tuple[Token, ...]) -> int:
    return sum((one.text in "([") - (one.text in ")]") for one in tokens if one.kind == "sign")


def _in_header(here: _WordAtCursor, kind: str) -> bool:
    """Whether a new name is being written: a parameter, or a variable of a quantifier."""
    if kind == "def" and all(one.text != ")" or _depth(here.before[: at + 1]) for at, one in enumerate(here.before)):
        return here.back(1) in ("(", ",") and _depth(here.before) == 1
    for token in reversed(here.before):
        if token.text in ("forall", "exists", "∀", "∃"):
            return True
        if token.text in ("in", ":") or (token.kind != "name" and token.text != ","):
            return False
    return False


def _after_operand(here: _WordAtCursor, kind: str) -> Iterator[CompletionItem]:
    """What can follow a whole formula: an operator, or on a new line the next statement."""
    text = here.document.text
    opens = not text[text.rfind("\n", 0, here.start) + 1 : here.start].strip()
    if opens and _depth(here.before) == 0:
        yield from _keywords(here, *STATEMENTS)
        yield here.item("camera", "keyword", about=vocabulary.CLAUSE_TEXTS["camera"])
        yield here.item(ROBOT, "keyword", about=vocabulary.CLAUSE_TEXTS[ROBOT])
        yield here.item("usually", "keyword", about=vocabulary.CLAUSE_TEXTS["usually"])
    if not here.before:
        return
    if kind == "object" and _depth(here.before) == 0:
        yield from _keywords(here, "at")
        words = ("by area",) if _in_support(here.before) else ("on", "of")
        for word in words:
            yield here.item(word, "keyword", about=vocabulary.CLAUSE_TEXTS[word])
    elif kind == "camera" and _depth(here.before) == 0:
        for word in ("looks at", "fov"):
            yield here.item(word, "keyword", about=vocabulary.CLAUSE_TEXTS[word])
    elif kind in ("label", "def", "require", "formula"):
        waiting = [one.text for one in here.before if one.text in ("forall", "exists", "∀", "∃", ":")]
        if waiting[-1:] not in ([], [":"]) and here.back(1) != "in":
            yield from _keywords(here, "in")
        yield from _keywords(here, "and", "or", "implies")


def _keywords(here: _WordAtCursor, *words: str) -> Iterator[CompletionItem]:
    for word in words:
        yield here.item(word, "keyword", about=vocabulary.KEYWORDS_IN_WORDS[word])


def _assets(here: _WordAtCursor) -> Iterator[CompletionItem]:
    for name in ASSETS:
        yield here.item(name, "asset", asset(name))


def _files(document: Document, offset: int) -> Iterator[CompletionItem]:
    """The specs that an import can name, or the tables of recorded poses."""
    start = document.text.rfind('"', 0, offset) + 1
    statement = document.index.statement(start - 1)
    if document.path is None or statement is None or statement.kind not in ("import", "usually"):
        return
    folder, ending = document.path.parent, ".spec" if statement.kind == "import" else TABLE_ENDING
    for path in sorted(folder.glob(f"*{ending}")) if folder.is_dir() else ():
        if path.name != document.path.name:
            yield CompletionItem(path.name, "file", "", "", start, offset)


def _in_support(tokens: tuple[Token, ...]) -> bool:
    """Whether the tokens of an `object` statement end in a clause `on ...`."""
    for at in range(len(tokens) - 1, 1, -1):
        if tokens[at].text == "," and _depth(tokens[: at + 1]) == 0:
            return False
        before = tokens[at - 1].text
        if tokens[at].text == "on" and _depth(tokens[:at]) == 0 and before not in ("object", ",", "=", "."):
            return True
    return False


def _opens_support(here: _WordAtCursor) -> bool:
    """Whether a surface is being written: after `on`, after `any of`, or in a list after these."""
    if not _in_support(here.before):
        return False
    return here.back(1) == "on" or (here.back(1), here.back(2)) == ("of", "any") or here.back(1) in ("[", ",")


def _names_things(here: _WordAtCursor) -> bool:
    """Whether a thing of a `usually` statement is to come, before the sign `~`. Without a name after it the word is not
    known as a keyword yet: it opens a line."""
    at = next((at for at in range(len(here.before) - 1, -1, -1) if here.before[at].text == "usually"), -1)
    tokens = here.before[at:]
    text = here.document.text
    if at < 0 or "~" in [one.text for one in tokens] or text[: tokens[0].start].rpartition("\n")[2].strip():
        return False
    inside = (here.back(2), here.back(1)) == ("theta", "(") and _depth(tokens) == 1
    return inside or (here.back(1) in ("usually", ",") and _depth(tokens) == 0)


def _things(here: _WordAtCursor) -> Iterator[CompletionItem]:
    """What a `usually` statement can be about: objects and arrays that nothing holds, and their headings."""
    for name, binding in sorted(here.document.values.items()):
        held = re.search(r"\bat\b", binding.source.text[binding.end : binding.closes])
        if binding.kind == "object" and not binding.inferred and not held:
            yield here.item(name, binding.kind, *here.document.notes[binding])
    if here.back(1) != "(":
        yield from _functions(here, ("theta",))


def _regions(here: _WordAtCursor) -> Iterator[CompletionItem]:
    """What places can be uniform over."""
    for name, binding in sorted(here.document.values.items()):
        if binding.kind == "region":
            yield here.item(name, binding.kind, *here.document.notes[binding])
    yield here.item("workspace", "keyword", about=vocabulary.BUILT_IN_TEXTS["workspace"])


def _lists_distributions(tokens: tuple[Token, ...]) -> bool:
    """Whether the tokens of a `usually` statement end in the list after `~`, in no bracket inside of it."""
    after = [at for at, one in enumerate(tokens) if one.text == "~"]
    return bool(after) and tokens[after[0] + 1].text == "[" and _depth(tokens[after[0] :]) == 1


def _supports(here: _WordAtCursor) -> Iterator[CompletionItem]:
    """What can carry an object: other objects with a surface, regions, the table."""
    if here.back(1) == "on":
        yield here.item("any of", "keyword", about=vocabulary.CLAUSE_TEXTS["any of"])
    tokens = here.before
    mine = [
        after.text
        for at, (one, after) in enumerate(pairwise(tokens))
        if one.text in ("object", ",") and _depth(tokens[: at + 1]) == 0
    ]
    for name, binding in sorted(here.document.values.items()):
        if name in mine[-1:]:
            continue
        if binding.kind == "region" or (binding.kind == "object" and _surfaces(binding)):
            yield here.item(name, binding.kind, *here.document.notes[binding])
    yield here.item("workspace", "keyword", about=vocabulary.BUILT_IN_TEXTS["workspace"])


def _surfaces(binding: Binding) -> tuple[str, ...]:
    """The names of an object's surfaces, as its declaration says what it is."""
    written = binding.source.text[binding.end : binding.closes]
    shape = written.partition("=")[2].split("(")[0].split()
    word = shape[0] if shape and not written.lstrip().startswith(("on", "at")) else binding.name
    if word in SHAPE_WORDS:
        return ("top",)
    return tuple(one.name for one in surfaces_of(shape_of(word)))


def _members(here: _WordAtCursor) -> Iterator[CompletionItem]:
    binding = here.document.values.get(here.back(2))
    if binding is not None and binding.kind == "object" and not binding.is_array:
        for name in _surfaces(binding):
            yield here.item(name, "member", about="a surface that things can stand on")
    for name in _members_of(here):
        yield here.item(name, "member", about=vocabulary.MEMBER_TEXTS[name])


def _members_of(here: _WordAtCursor) -> tuple[str, ...]:
    base = here.back(2)
    place = here.before[-2].start if len(here.before) > 1 else 0
    if len(here.before) > 2 and here.back(3) == ".":
        return () if base in (*SIDES, *CORNERS, *SIZES, "count") else (*MEMBERS, *SURFACE_SIZES, *LIST_MEMBERS)
    local = _locals(here, place).get(base)
    binding = local or here.document.values.get(base)
    if base == "workspace":
        return MEMBERS
    if base == "objects" or (binding is not None and binding.is_array):
        return LIST_MEMBERS
    if base in ("]", ")") or (binding is not None and binding.kind in ("parameter", "variable")):
        return (*MEMBERS, *LIST_MEMBERS)
    if binding is None or binding.kind not in ("region", "constant"):
        return ()
    shape = binding.source.text[binding.end : binding.closes].lstrip("= \t\n").split("(")[0].strip()
    return {"circle": (*SIDES, *SIZES), "polygon": (*SIDES, "corners", *SIZES), "rect": MEMBERS}.get(shape, ())


def _locals(here: _WordAtCursor, offset: int) -> dict[str, Binding]:
    """Parameters and variables that can be used at an offset, the innermost of a name."""
    reaches = here.document.index.reaches
    inside = [one for one in reaches if one.start <= offset < one.end or one.start <= offset == one.end]
    return {one.binding.name: one.binding for one in sorted(inside, key=lambda one: one.start)}


def _operands(here: _WordAtCursor, kind: str) -> Iterator[CompletionItem]:
    document = here.document
    constant = kind in ("const", "workspace", "object", "region", "camera")
    called = _open_call(here)
    if called and here.back(1) in ("(", ","):
        yield from _arguments(here, called)
    for name, binding in _locals(here, here.start).items():
        yield here.item(name, binding.kind, f"of {binding.owner}" if binding.owner else "", "")
    hidden = here.before[1].text if kind == "const" and len(here.before) > 1 else ""
    for name, binding in sorted(document.values.items()):
        if name == hidden or (constant and binding.kind in ("object", "label")):
            continue
        if binding.inferred and binding.start == here.start:
            continue  # an object that nothing declares, but the word that is being written
        yield here.item(name, binding.kind, *document.notes[binding])
    for name in BUILT_IN:
        yield here.item(name, "keyword", about=vocabulary.BUILT_IN_TEXTS[name])
    if not constant:
        for name, binding in sorted(document.functions.items()):
            if not name.startswith("_"):
                yield here.item(name, "definition", *document.notes[binding])
    yield from _functions(here, [name for name in vocabulary.functions() if name not in (*SHAPE_WORDS, *AREAS, "arm")])
    if not constant:
        yield from _keywords(here, "forall", "exists", "not", "true", "false")


def _functions(here: _WordAtCursor, names: tuple[str, ...] | list[str]) -> Iterator[CompletionItem]:
    for name in names:
        usage, about = vocabulary.functions()[name]
        yield here.item(name, "function", usage, about)


def _open_call(here: _WordAtCursor) -> str:
    """The function whose parenthesis the cursor is in."""
    depth = 0
    for at in range(len(here.before) - 1, 0, -1):
        token = here.before[at]
        depth += (token.text in (")", "]")) - (token.text in ("(", "["))
        if depth < 0:
            name = here.before[at - 1]
            return name.text if token.text == "(" and name.kind == "name" and name.text not in KEYWORDS else ""
    return ""


def _arguments(here: _WordAtCursor, called: str) -> Iterator[CompletionItem]:
    definition = here.document.functions.get(called)
    if definition is not None:
        for one in here.document.parameters(definition):
            yield here.item(f"{one.name} = ", "argument", f"of {called}")
