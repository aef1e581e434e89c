"""The names of one file, found by its tokens: what each statement declares, and where each name is used.

Editors send texts that do not parse, so nothing here needs a tree. The kind of a name follows from its context, as in
the grammar: a call from its parenthesis, a member from its dot, a label from its colon; parameters and variables of
quantifiers hide other names within their scope.
"""

from __future__ import annotations

import contextlib
from bisect import bisect_left, bisect_right
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from functools import cache, lru_cache
from pathlib import Path
from typing import Literal

from scenegen.errors import Source, SpecError
from scenegen.geometry import PRIMITIVES
from scenegen.lang.check.regions import SIGNATURES
from scenegen.lang.check.scope import ARMS, HEIGHTS, LIST_FUNCTIONS, SIGHT, signature_of, signatures
from scenegen.lang.syntax import ast
from scenegen.lang.syntax.parse import parse
from scenegen.lang.syntax.printer import print_expr
from scenegen.lang.syntax.tokens import KEYWORDS, ROBOT, STATEMENTS, Token, has_time, openings, scan

Kind = Literal["object", "region", "camera", "constant", "definition", "label", "parameter", "variable"]
Role = Literal["declaration", "value", "call", "member", "argument", "asset", "import"]

_OPENS, _CLOSES = ("(", "["), (")", "]")
_QUANTIFIERS = ("forall", "exists", "∀", "∃")
_DECLARING: dict[str, Kind] = {"region": "region", "camera": "camera", "const": "constant", "def": "definition"}


@dataclass(frozen=True, slots=True, eq=False)
class Binding:
    """What gives a name its meaning. Characters `start` to `end` are the name, `opens` to `closes` all that declares
    it: its statement, or the entry of an `object` statement or parameter list. `owner` is a parameter's definition."""

    kind: Kind
    name: str
    source: Source
    path: Path | None
    start: int
    end: int
    opens: int
    closes: int
    owner: str = ""
    is_array: bool = False
    inferred: bool = False


@dataclass(frozen=True, slots=True, eq=False)
class Occurrence:
    """A name in the text. `local` is its meaning if this file alone determines it: declarations, parameters, variables.
    `of` is the function of a named argument, and the name before the dot of a member."""

    name: str
    start: int
    end: int
    role: Role
    local: Binding | None = None
    of: str = ""


@dataclass(frozen=True, slots=True)
class NameScope:
    """Where a parameter or variable can be used."""

    binding: Binding
    start: int
    end: int


@dataclass(frozen=True, slots=True)
class StatementSpan:
    """`kind` is the keyword that opens it, "label", or "formula" for anything else."""

    kind: str
    start: int
    end: int
    tokens: tuple[Token, ...]


@dataclass(slots=True)
class NameIndex:
    """All findings from the tokens of a file, each list in the order of the text."""

    source: Source
    path: Path | None
    statements: list[StatementSpan] = field(default_factory=list)
    declarations: list[Binding] = field(default_factory=list)
    occurrences: list[Occurrence] = field(default_factory=list)
    reaches: list[NameScope] = field(default_factory=list)
    imports: list[Occurrence] = field(default_factory=list)

    def names_between(self, start: int, end: int) -> list[Occurrence]:
        """The names that begin before `end` and end after `start`."""
        first = bisect_right(self.occurrences, start, key=lambda one: one.end)
        last = bisect_left(self.occurrences, end, key=lambda one: one.start)
        return self.occurrences[first:last]

    def statement(self, offset: int) -> StatementSpan | None:
        """The last statement that opens at or before an offset."""
        at = bisect_right(self.statements, offset, key=lambda one: one.start)
        return self.statements[at - 1] if at else None


def index(source: Source, path: Path | None = None) -> NameIndex:
    """The index of a text, whatever it holds. Linear in its length."""
    found = NameIndex(source, path)
    for statement in _statements(source.text):
        found.statements.append(statement)
        _Walk(found, statement).run()
    return found


def _statements(text: str) -> Iterator[StatementSpan]:
    tokens = [token for token in scan(text, timed=has_time(text)) if token.kind != "comment"]
    starts = [start for start, _ in openings(text, tokens)]
    at = 0
    for following in (*starts, len(text) + 1):
        first = at
        while at < len(tokens) and tokens[at].start < following:
            at += 1
        if at > first:
            own = tuple(tokens[first:at])
            yield StatementSpan(_kind(own), own[0].start, own[-1].end, own)


def _kind(tokens: tuple[Token, ...]) -> str:
    if tokens[0].text == ROBOT and tokens[1:2] and tokens[1].kind == "name":
        return "object"  # a robot is one
    if tokens[0].text in STATEMENTS and not (tokens[0].text == "workspace" and tokens[1:2] and tokens[1].text == "."):
        return tokens[0].text
    if tokens[0].text == "camera" and len(tokens) > 1 and tokens[1].kind == "name":
        return "camera"
    if tokens[0].text == "usually" and len(tokens) > 1 and tokens[1].kind == "name":
        return "usually"
    is_label = len(tokens) > 1 and tokens[1].text == ":" and tokens[0].kind == "name"
    return "label" if is_label else "formula"


@dataclass(slots=True)
class _Quantifier:
    """`start` is its keyword, `depth` the number of brackets around it, `begins` its body; -1 until the colon."""

    start: int
    depth: int
    variables: list[Binding] = field(default_factory=list)
    begins: int = -1


def _chooses(before: str, word: str, after: str) -> bool:
    """Whether a word belongs to a choice of supports or assets: after an object, not its name."""
    return (
        (before, word, after) == ("on", "any", "of")
        or (before, word) in (("any", "of"), ("by", "area"))
        or (word, after) in (("by", "area"), ("of", "category"))
    )


class _Walk:
    """One pass over the tokens of a statement."""

    def __init__(self, found: NameIndex, statement: StatementSpan) -> None:
        self.found = found
        self.statement = statement
        self.brackets: list[tuple[str, str]] = []  # each open bracket with the function it belongs to, if any
        self.quantifiers: list[_Quantifier] = []
        self.parameters: dict[str, Binding] = {}
        self.in_header = statement.kind == "def"
        self.body = statement.end  # where the parameters begin to count

    def run(self) -> None:
        tokens = self.statement.tokens
        variables = False  # between a quantifier and its `in`
        for at, token in enumerate(tokens):
            before = tokens[at - 1].text if at else ""
            after = tokens[at + 1].text if at + 1 < len(tokens) else ""
            if token.text in _QUANTIFIERS:
                self.quantifiers.append(_Quantifier(token.start, len(self.brackets)))
                variables = True
            elif token.kind == "name" and token.text not in KEYWORDS:
                if variables:
                    quantifier = self.quantifiers[-1]
                    quantifier.variables.append(self._bind("variable", token, quantifier.start, token.end))
                else:
                    self._name(token, at, before, after)
            elif token.text == "workspace" and (at or self.statement.kind != "workspace"):
                self._use(token, "value")
            elif token.kind == "text" and self.statement.kind == "import":
                self.found.imports.append(Occurrence(token.text[1:-1], token.start, token.end, "import"))
            elif not (variables and token.text == ","):
                variables = False
                self._sign(token, tokens[at - 1] if at else None)
        self._end(-1, self.statement.end)
        self.found.reaches.extend(NameScope(one, self.body, self.statement.end + 1) for one in self.parameters.values())

    def _sign(self, token: Token, previous: Token | None) -> None:
        if token.text in _OPENS:
            called = previous.text if previous is not None and previous.kind == "name" and token.text == "(" else ""
            self.brackets.append((token.text, called if called not in KEYWORDS else ""))
        elif token.text in _CLOSES:
            if self.brackets:
                self.brackets.pop()
            self._end(len(self.brackets), token.start)
            self.in_header = self.in_header and bool(self.brackets)
            if self.statement.kind == "def" and not self.in_header and self.body == self.statement.end:
                self.body = token.end
        elif token.text == ",":
            self._end(len(self.brackets) - 1, token.start)
        elif token.text == ":":
            waiting = [one for one in self.quantifiers if one.begins < 0]
            if waiting:
                waiting[-1].begins = token.end

    def _end(self, depth: int, at: int) -> None:
        """Close the quantifiers that stand deeper than `depth` brackets."""
        while self.quantifiers and self.quantifiers[-1].depth > depth:
            done = self.quantifiers.pop()
            if done.begins >= 0:
                last = at + (at == self.statement.end)
                self.found.reaches.extend(NameScope(one, done.begins, last) for one in done.variables)

    def _name(self, token: Token, at: int, before: str, after: str) -> None:
        kind, depth = self.statement.kind, len(self.brackets)
        tokens = self.statement.tokens
        if before == "." and at:
            base = tokens[at - 2] if at > 1 else None
            self._use(token, "member", base.text if base is not None and base.kind == "name" else "")
        elif kind == "label" and at == 0:
            self._bind("label", token, self.statement.start, self.statement.end)
        elif kind == "camera" and (at == 0 or (depth == 0 and token.text in ("looks", "fov") and at > 1)):
            return  # `camera front = at ... looks at ... fov ...`: no keywords elsewhere
        elif kind == "usually" and (at == 0 or (token.text in DISTRIBUTION_TEXTS and before in ("~", "[", ",", ""))):
            return  # `usually mug ~ normal(...)`: names elsewhere
        elif kind in _DECLARING and at == 1:
            self._bind(_DECLARING[kind], token, self.statement.start, self.statement.end)
        elif kind == "object" and at == 0:
            return  # `robot`, which is a name elsewhere
        elif kind == "object" and depth == 0 and (before in ("object", ",") or at == 1):
            closes = self._closes(at)
            self._bind("object", token, token.start, closes, is_array=after == "[")
        elif kind == "object" and depth == 0 and before == "=" and after != "(":
            self._use(token, "asset")
        elif kind == "object" and depth == 0 and token.text == "on" and before != "on":
            return  # `object book on shelf`: no keyword elsewhere
        elif kind == "object" and depth == 0 and _chooses(before, token.text, after):
            return  # `on any of [...] by area`
        elif kind == "workspace" and depth == 0 and token.text == "x":
            return
        elif self.in_header and depth == 1 and before in ("(", ","):
            owner = tokens[1].text if len(tokens) > 1 else ""
            binding = self._bind("parameter", token, token.start, self._closes(at), owner=owner)
            self.parameters[token.text] = binding
        elif after == "(":
            self._use(token, "call")
        elif after == "=" and depth and before in ("(", ",") and self.brackets[-1][1]:
            self._use(token, "argument", self.brackets[-1][1])
        else:
            self._use(token, "value")

    def _closes(self, at: int) -> int:
        """Where the entry of a list ends that token `at` begins: before the next `,` or `)` of its own level."""
        depth = 0
        end = self.statement.tokens[at].end
        for token in self.statement.tokens[at + 1 :]:
            if depth == 0 and token.text in (",", ")", "]"):
                break
            depth += (token.text in _OPENS) - (token.text in _CLOSES)
            end = token.end
        return end

    def _bind(
        self, kind: Kind, token: Token, opens: int, closes: int, owner: str = "", is_array: bool = False
    ) -> Binding:
        source, path = self.found.source, self.found.path
        binding = Binding(kind, token.text, source, path, token.start, token.end, opens, closes, owner, is_array)
        self.found.occurrences.append(Occurrence(token.text, token.start, token.end, "declaration", binding))
        if kind not in ("parameter", "variable"):
            self.found.declarations.append(binding)
        return binding

    def _use(self, token: Token, role: Role, of: str = "") -> None:
        local = self._local(token.text) if role == "value" else None
        self.found.occurrences.append(Occurrence(token.text, token.start, token.end, role, local, of))

    def _local(self, name: str) -> Binding | None:
        for quantifier in reversed(self.quantifiers):
            if quantifier.begins >= 0:
                for variable in quantifier.variables:
                    if variable.name == name:
                        return variable
        return None if self.in_header else self.parameters.get(name)


KEYWORDS_IN_WORDS: Mapping[str, str] = {
    "workspace": "the table: workspace [0, 1] x [0, 1], in metres",
    "object": "what stands on the table: object mug, block[7] = box(5 cm, 5 cm, 5 cm), tray at (0.5, 0.5)",
    "region": "a named part of the table: region placemat = rect(0.3, 0, 0.7, 0.2)",
    "const": "a named number or point: const NEAR = 25 cm",
    "def": "a relation or function of one's own: def beside(a, b, e = 10 cm) = dist(a, b) <= e",
    "require": "what holds in every scene, and is not part of phi: require noOverlap()",
    "import": 'the statements of another file: import "table.spec"',
    "forall": "a formula for all: forall i in 1..6: leftOf(block[i], block[i + 1])",
    "exists": "a formula for at least one: exists p in block: closeTo(p, mug)",
    "in": "what a quantifier ranges over: a range, an array, a list, consecutive(list)",
    "at": "holds an object in place: object tray at (0.5, 0.5, 90 deg)",
    "and": "both: phi is the smaller of the two (also `&`)",
    "or": "one of them: phi is the larger of the two (also `|`)",
    "not": "the opposite: phi with the other sign (also `!`)",
    "implies": "if the left, then the right: phi is max(-left, right) (also `->`)",
    "true": "holds in every scene",
    "false": "holds in no scene",
}

CLAUSE_TEXTS: Mapping[str, str] = {
    ROBOT: "an arm, with the base where it stands: robot arm = panda at (0.5, -0.25, NORTH)",
    "on": "what an object stands on: object mug on tray, book on shelfunit.shelf[2]",
    "camera": "a camera: camera front = at (0.5, -0.6, 0.7) looks at (0.5, 0.4, 0) fov 60 deg, 4:3",
    "looks at": "the point that a camera looks at: looks at (0.5, 0.4, 0)",
    "fov": "the angle of a picture's height, then its width and height: fov 60 deg, 4:3",
    "usually": "where a thing usually is: usually mug ~ normal((0.4, 0.3), 5 cm); headings: usually theta(mug) ~ ...",
    "of": 'another asset of an index in each scene: object mug of category("mug")',
    "any of": "one of several surfaces, all equally likely: object mug on any of [tray, workspace]",
    "by area": "surfaces are as likely as they are large: object mug on any of [tray, workspace] by area",
}

DISTRIBUTION_TEXTS: Mapping[str, str] = {
    "normal": "normal((0.4, 0.3), 5 cm), normal(saucer, 3 cm), of headings normal(NORTH, 10 deg): a middle, which may "
    "depend on other things, and the standard deviation",
    "uniform": "uniform(left), of headings uniform(80 deg, 100 deg)",
    "poses": 'poses("logs.csv", 1 cm, 5 deg): recorded poses, moved by up to so much and turned by up to so much',
}

BUILT_IN_TEXTS: Mapping[str, str] = {
    "objects": "the list of all objects",
    "workspace": "the table as a region, with .left .right .top .bottom .center",
}

_COORDINATE_TEXTS = {
    "x": "the x coordinate of the centre, in metres, to the right",
    "y": "the y coordinate of the centre, in metres, away from the viewer",
    "theta": "the heading of an object, counter-clockwise from the x axis, in radians",
}

_SHAPE_TEXTS = {
    "box": "an upright box: its length along the heading, its width and height",
    "cylinder": "an upright cylinder",
    "prism": "an upright prism over a convex polygon",
    "urdf": "a robot description file; its outline is the hull of its collision shapes",
    "mesh": "a mesh file, .obj, .stl, .glb or .gltf in metres; its outline is its convex hull",
    "asset": 'an asset of the index assets.toml beside the spec, or of a folder\'s: "ycb/025_mug"',
    "category": "another asset of the index in each scene, of those that have the category",
    "arm": "a robot's arm, as a TOML file says it: its reach from above, its base and its hand",
    "cabinet": "a chest of drawers: how many, and by which share they are open: 0.6 is the top one, a list is one each",
    "rect": "a rectangle, by the coordinates of its sides",
    "circle": "a disc",
    "polygon": "a convex polygon, by its corners",
}

MEMBER_TEXTS: Mapping[str, str] = {
    "left": "the middle of the left side",
    "right": "the middle of the right side",
    "top": "the middle of the far side",
    "bottom": "the middle of the near side",
    "center": "the centre",
    "topLeft": "the far left corner",
    "topRight": "the far right corner",
    "bottomLeft": "the near left corner",
    "bottomRight": "the near right corner",
    "corners": "the list of corners, counter-clockwise",
    "width": "the extent along x, of a surface across the object's heading, in metres",
    "height": "the extent along y, in metres",
    "length": "of a surface: the extent along the object's heading, in metres",
    "depth": "of a surface inside something: the free height over it, in metres",
    "first": "the first of a list",
    "last": "the last of a list",
    "count": "how many a list has",
}

UNIT_TEXTS: Mapping[str, str] = {
    "m": "metres",
    "cm": "centimetres",
    "mm": "millimetres",
    "rad": "radians",
    "deg": "degrees",
    "turn": "full turns",
    "%": "hundredths",
}


@cache
def functions() -> Mapping[str, tuple[str, str]]:
    """Usage and meaning of every built-in function, including shapes of objects and regions."""
    table = {name: (signature.usage, _meaning(name)) for name, signature in signatures().items()}
    return table | {name: (SIGNATURES[name].usage, words) for name, words in _SHAPE_TEXTS.items()}


def _meaning(name: str) -> str:
    if name in _COORDINATE_TEXTS:
        return _COORDINATE_TEXTS[name]
    if name in HEIGHTS:
        return HEIGHTS[name]
    if name in SIGHT:
        return SIGHT[name]
    if name in ARMS:
        return ARMS[name]
    return LIST_FUNCTIONS[name] if name in LIST_FUNCTIONS else PRIMITIVES[name].doc


def remark(binding: Binding) -> str:
    """The comment that explains a declaration: behind it on its line, else on the lines right above it.

    The comment that opens a file is its title: it explains a definition at most.
    """
    text = binding.source.text
    end = text.find("\n", binding.closes)
    rest = text[binding.closes : len(text) if end < 0 else end]
    comment = next((token for token in scan(rest) if token.kind == "comment"), None)
    if comment is not None and not rest[: comment.start].strip(" \t,)"):
        return comment.text.lstrip("#").strip()
    start = text.rfind("\n", 0, binding.opens) + 1
    if text[start : binding.opens].strip() and binding.kind != "object":
        return ""
    above: list[str] = []
    while start > 0:
        before = text.rfind("\n", 0, start - 1) + 1
        line = text[before : start - 1].strip()
        if not line.startswith("#"):
            break
        above.insert(0, line.lstrip("#").strip())
        start = before
    if start == 0 and binding.kind != "definition":
        return ""
    return " ".join(above)


def notes(binding: Binding) -> tuple[str, str]:
    """The text beside a declaration in a list of completions: its usage or value, and its purpose."""
    if binding.kind == "definition":
        called, formula = usage(binding)
        return called, remark(binding) or formula
    written = " ".join(binding.source.text[binding.end : binding.closes].split()).lstrip("=: ")
    return (written[:60] if binding.kind in ("constant", "region", "camera") else ""), remark(binding)


def usage(definition: Binding) -> tuple[str, str]:
    """How a definition is called, and its formula; as far as its text can be parsed."""
    return _usage(definition.name, definition.source.text[definition.opens : definition.closes])


@lru_cache(maxsize=10_000)
def _usage(name: str, written: str) -> tuple[str, str]:
    """Cached by text, so definitions that do not change are not parsed again."""
    with contextlib.suppress(SpecError):
        for statement in parse(Source("<definition>", written)).statements:
            if isinstance(statement, ast.Definition):
                return signature_of(statement).usage, print_expr(statement.body)
    return f"{name}(...)", ""
