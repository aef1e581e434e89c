"""A problem -> the text of a spec, formatted.

What the goal moves can be anywhere on the ground, where the goal has it, or on what it starts on; where it starts is
the label `start`. Everything else stays where it starts.
"""

from __future__ import annotations

import itertools
import math
import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from difflib import get_close_matches

from scenegen.errors import DataError, Diagnostic, Source, SpecError
from scenegen.errors.diagnostic import nearest
from scenegen.errors.worlds import (
    FACTS_MEAN_NOTHING,
    IMPORT_FAILS,
    MAP_NAMES_NOTHING,
    NO_SPATIAL_GOAL,
    PDDL_FORM,
    UNKNOWN_PREDICATE,
)
from scenegen.geometry import Circle
from scenegen.lang.checker import check_text
from scenegen.lang.syntax.printer import format_source
from scenegen.planning.goal import (
    COMMON_PREDICATES,
    LIBERO_PREDICATES,
    NO_PLACE,
    GoalReader,
    NameMap,
    PredicateFormula,
    TranslatedFormula,
    key,
    plain,
    relation,
)
from scenegen.planning.problem import Node, PddlProblem, SExprAtom, SExprList
from scenegen.planning.setting import Rectangle, Referent, Setting, category, enclosing, shape_from, supports_of
from scenegen.things.surfaces import reach_of


def collisions(setting: Setting, options: dict[str, list[str]]) -> list[str]:
    """`require` statements for all pairs of things, furniture and boards whose boxes, seen from above, can meet.

    `options` are the surfaces of each thing. What the one carries is not left out: it could be beside it.
    """
    boards = {name: area.box or setting.space for name, area in setting.used.items() if area.board}
    boxes: dict[str, Rectangle] = {}
    fixed = set(boards)
    for name, made in setting.furniture.items():
        if made.body is not None:
            x, y, _ = setting.poses.get(name, (0.0, 0.0, 0.0))
            boxes[setting.ids[name]] = grow((x, y, x, y), max(made.body[:2]) * 0.75)
            fixed.add(setting.ids[name])
    for name, shape in setting.shapes.items():
        reach = reach_of(shape_from(shape).footprint)
        places = [_box(setting, one, boxes) for one in options.get(name) or ["workspace"]]
        boxes[setting.ids[name]] = grow(enclosing(places), reach)
    return [
        f"require apart({one}, {other}) >= 0"
        for (one, first), (other, second) in itertools.combinations({**boxes, **boards}.items(), 2)
        if not (one in fixed and other in fixed) and overlap(first, second)
    ]


def _box(setting: Setting, surface: str, boxes: dict[str, Rectangle]) -> Rectangle:
    """Where the centre of what stands on a surface can be. What stands on things of which no box is known yet can be
    anywhere."""
    if surface in setting.used:
        return setting.used[surface].box or setting.space
    return boxes.get(surface, setting.space)


def grow(box: Rectangle, by: float) -> Rectangle:
    return box[0] - by, box[1] - by, box[2] + by, box[3] + by


def overlap(one: Rectangle, other: Rectangle) -> bool:
    return one[0] < other[2] and other[0] < one[2] and one[1] < other[3] and other[1] < one[3]


MAX_QUOTE_LENGTH = 100  # characters of the source in a comment
OVER_ALL = ("reachableFromAbove", "others", "objects", "load", "stable", "noOverlap", "noCollision")  # take all things
ADVICE = {  # where a spec fails for another reason than sizes, by code
    "constant-label": "the goal holds in every scene or in none, whatever the sizes: ask for less, or for more",
    "too-many-cases": "leave out some of the things, or of what the goal puts them on",
}
PROPOSED = {1: "reachableFromAbove($1)", 2: "restsOn($1, $2)", 3: "between($1, $2, $3)"}  # by number of arguments
MIN_SIMILARITY = 0.81  # of difflib: a name of a map for others is seldom so like one of this problem
MIN_HEADING_TOLERANCE = math.radians(5.0)  # the least tolerance of a heading that a region gives


@dataclass(frozen=True, slots=True)
class CompiledProblem:
    """How a problem was read: what became of its things, and the formula of each fact that it mentions, by predicate
    and names. `known` says what a predicate means."""

    problem: PddlProblem
    setting: Setting
    formulas: Mapping[tuple[str, tuple[str, ...]], str]
    known: Callable[[str], PredicateFormula | None]


@dataclass(frozen=True, slots=True)
class Imported:
    """A spec's text, with what of the problem is not in it: facts and parts of the goal without geometry."""

    text: str
    lost: tuple[str, ...]
    warnings: tuple[Diagnostic, ...]
    reading: CompiledProblem = field(repr=False, compare=False)


@dataclass(slots=True)
class _Compiler:
    problem: PddlProblem
    setting: Setting
    table: NameMap
    lost: list[str] = field(default_factory=list)
    unknown: dict[str, Diagnostic] = field(default_factory=dict)
    comments: list[str] = field(default_factory=list)  # comments of the formula being read
    wanted: list[tuple[str, Referent, str]] = field(default_factory=list)  # mover, carrier, its name
    unwanted: list[tuple[str, str]] = field(default_factory=list)  # a thing, and what it is not to be on
    bodiless: list[str] = field(default_factory=list)  # things of relations that have no body
    arities: dict[str, int] = field(default_factory=dict)  # predicates of the problem, and their arguments
    tried: dict[str, int] = field(default_factory=dict)  # those of them that the map has, and their arguments
    formulas: dict[tuple[str, tuple[str, ...]], str] = field(default_factory=dict)

    def line(self, node: Node) -> str:
        text = " ".join(node.span.text.split())
        if len(text) > MAX_QUOTE_LENGTH:
            text = f"{text[: MAX_QUOTE_LENGTH - 3]}..."
        return f"line {self.problem.source.position(node.span.start)[0]}: {text}"

    def lose(self, node: Node, why: str = NO_PLACE) -> TranslatedFormula:
        line = f"{why}, {self.line(node)}"
        if line not in self.lost:
            self.lost.append(line)
        return TranslatedFormula(None, whole=False)

    def predicate_formula(self, name: str) -> PredicateFormula | None:
        mapped = {plain(key): value for key, value in self.table.predicates.items()}
        name = plain(name)
        if name in mapped:
            return relation(mapped[name])
        return (LIBERO_PREDICATES.get(name) if self.problem.regions else None) or COMMON_PREDICATES.get(name)

    def atom(self, node: SExprList, names: Sequence[str], wanted: bool) -> TranslatedFormula:
        self.arities[plain(node.head)] = max(len(names), self.arities.get(plain(node.head), 0))
        mapped = self._is_mapped(node.head, len(names))
        found = self.predicate_formula(node.head)
        declared = self.problem.domain.predicates.get(node.head)
        arity = declared if declared is not None or found is None else found.arity
        if arity is not None and 0 <= arity != len(names):
            raise DataError(PDDL_FORM(node.span, wanted=f"a fact of `{node.head}`", reason=f"it takes {arity}"))
        if found is not None and not mapped and not found.takes(len(names)):
            found = None  # the domain's own predicate of that name
        if found is None:
            self.unknown.setdefault(node.head, _unknown_predicate(node, len(names)))
        if found is None or (not found.formula and not found.holds):
            return self.lose(node)
        bodiless = [name for name in names if name in self.setting.without]
        if bodiless:
            self.bodiless += bodiless
            return self.lose(node)
        refs = [self.setting.resolve(name, part) for name, part in zip(names, node.rest, strict=True)]
        if (found.holds or len(found.places) == 1) and refs[found.places[0]].kind != "thing":
            return self.lose(node)
        self.comments.append(self.line(node))
        text = self._formula(found, names, refs, wanted)
        self.formulas.setdefault((node.items[0].span.text, tuple(names)), text)
        return TranslatedFormula(text, whole=len(self.setting.grounds) < 2 or all(one.kind != "ground" for one in refs))

    def _formula(self, found: PredicateFormula, names: Sequence[str], refs: Sequence[Referent], wanted: bool) -> str:
        arguments = [one.argument for one in refs]
        if len({arguments[place] for place in found.places}) < len(found.places):
            return "false"  # nothing is in a relation with itself
        if not found.holds:
            return fill_arguments(found.formula, arguments)
        upper, lower = refs[:2]
        if wanted:
            self.wanted.append((upper.owner, lower, names[1]))
        else:
            self.unwanted.append((names[0], names[1]))
        if lower.kind != "thing":
            return resting_formula(upper.argument, lower)
        off = self.setting.carries(upper.owner, lower.owner, inside=found.holds == "in")
        return carried_formula(found, upper.argument, lower.argument, off)

    def _is_mapped(self, name: str, count: int) -> bool:
        """Whether the map has a predicate. Raises DataError for a formula that has not the arguments of its facts."""
        key = next((one for one in self.table.predicates if plain(one) == plain(name)), None)
        if key is None:
            return False
        formula = self.table.predicates[key]
        found = relation(formula)
        if found.holds and count < 2:
            reason = "it is of two things, and a fact has fewer"
            raise DataError(FACTS_MEAN_NOTHING(formula=formula, name=key, reason=reason))
        if found.formula:
            said = {int(one) for one in re.findall(r"\$(\d)", formula)}
            short = max(said, default=0) < count and name.lower() not in self.problem.domain.predicates
            if not said or min(said) < 1 or max(said) > count or short:
                named = " and ".join(f"${one}" for one in sorted(said)) or "none"
                reason = f"{count} arguments in a fact, and the formula names {named}"
                raise DataError(FACTS_MEAN_NOTHING(formula=formula, name=key, reason=reason))
            self.tried[key] = count
        return True


def _unknown_predicate(node: SExprList, count: int) -> Diagnostic:
    close = nearest(plain(node.head), {*LIBERO_PREDICATES, *COMMON_PREDICATES})
    near = [close] if close and close != plain(node.head) else []
    return UNKNOWN_PREDICATE(node.span, name=node.head, key=key(node.head), relation=PROPOSED.get(count), near=near)


def fill_arguments(formula: str, arguments: Sequence[str]) -> str:
    """A relation's formula with its arguments, in parentheses."""
    text = re.sub(
        r"\$(\d)", lambda one: arguments[int(one[1]) - 1] if 1 <= int(one[1]) <= len(arguments) else one[0], formula
    )
    return text if text.startswith("(") else f"({text})"


def resting_formula(upper: str, lower: Referent) -> str:
    """That a thing stands on the ground, or on a region."""
    if lower.kind == "ground":
        return f"z({upper}) <= EPS_LEVEL"
    parts = [f"restsOn({upper}, {one})" for one in lower.surfaces]
    return parts[0] if len(parts) == 1 else f"({' | '.join(parts)})"


def carried_formula(found: PredicateFormula, upper: str, lower: str, off: float) -> str:
    """That one thing carries another, whose height may be `off` by so many metres."""
    if found.holds == "in":
        return f"insideOf({upper}, {lower})"
    more = "" if off <= 0.001 else f", {math.ceil(off * 1000)} mm"
    text = f"restsOn({upper}, {lower}{more})"
    return text if found.near is None else f"({text} & dist({upper}, {lower}) <= {found.near:g} m)"


def compile_problem(problem: PddlProblem, table: NameMap) -> Imported:
    """Raises DataError for kinds, names and goals that mean nothing here, and for a spec that does not check."""
    setting = Setting(problem, table)
    setting.classify()
    own = _Compiler(problem, setting, table)
    for fact in problem.init:  # furniture is held first: where its boards are follows
        if isinstance(fact, SExprList) and len(_names(fact)) == 2 and plain(fact.head) in ("on", "ontop"):
            name, region = _names(fact)
            if name in setting.furniture and region in problem.regions and problem.regions[region].ranges:
                setting.place(name, problem.regions[region])
                setting.notes[name] = f"{own.line(fact)}, held in the middle"
    assert problem.goal is not None
    meaning = GoalReader(problem, own.atom, own.lose).read(problem.goal, {})
    goal_lines, own.comments = own.comments, []
    if meaning.text is None:
        raise DataError(_no_places(own, problem.goal))
    lines = _spec_lines(own, meaning.text, list(dict.fromkeys(goal_lines)))
    unused = _unused_names(own)
    text = "\n".join(lines) + "\n"
    try:
        text = format_source(Source(problem.source.name, text))
        check_text(text, problem.source.name)
    except SpecError as error:
        _refuse_formulas(own)
        first = error.diagnostics[0]
        advice = ADVICE.get(first.code)
        raise DataError(IMPORT_FAILS(file=problem.source.name, reason=first.title, advice=advice)) from None
    reading = CompiledProblem(problem, setting, own.formulas, own.predicate_formula)
    lost = (*own.lost, *(f"not read, {own.line(one)}" for one in problem.other))
    return Imported(text, lost, (*own.unknown.values(), *unused), reading)


def _no_places(own: _Compiler, goal: Node) -> Diagnostic:
    missing = sorted(own.arities)
    of_two = next((key(one) for one in missing if own.arities[one] == 2 and own.predicate_formula(one) is None), None)
    thing = own.bodiless[0] if own.bodiless else None
    kind = None if thing is None else key(own.problem.things[thing].kinds[0])
    file = own.problem.source.name
    return NO_SPATIAL_GOAL(goal.span, file=file, missing=missing, key=of_two, thing=thing, kind=kind)


def _refuse_formulas(own: _Compiler) -> None:
    """Refuse what the map makes of a predicate where it is no formula about things. Raises DataError."""
    for name, count in own.tried.items():
        things = [f"thing_{number}" for number in range(1, count + 1)]
        formula = own.table.predicates[name]
        try:
            check_text(f"object {', '.join(things)}\ngoal: {fill_arguments(formula, things)}\n")
        except SpecError as error:
            first = error.diagnostics[0]
            if first.code != "constant-label":
                raise DataError(FACTS_MEAN_NOTHING(formula=formula, name=name, reason=first.title)) from None


def _unused_names(own: _Compiler) -> list[Diagnostic]:
    """Notes on what a map has and this problem has not: it may serve several problems, or be misspelt."""
    words = {one for name, thing in own.problem.things.items() for one in (name, *thing.kinds)}
    words |= {one.partition(".")[0] for one in words} | {category(one) for one in words}
    predicates = {*own.arities, *own.problem.domain.predicates}
    notes, others = [], []
    for names, known, alike, bare in (
        (own.table.objects, words, str.lower, category),
        (own.table.predicates, predicates, plain, plain),
    ):
        had, mapped = {alike(one) for one in known}, {alike(one) for one in names}
        free = {bare(one): one for one in sorted(known) if alike(one) not in mapped}
        for name in (one for one in names if alike(one) not in had):
            close = get_close_matches(bare(name), free, 1, cutoff=MIN_SIMILARITY)
            if close:
                notes.append(MAP_NAMES_NOTHING(file="the map", names=[name], nearest=free[close[0]]))
            else:
                others.append(name)
    return notes + ([MAP_NAMES_NOTHING(file="the map", names=others)] if others else [])


def _spec_lines(own: _Compiler, goal: str, goal_lines: Sequence[str]) -> list[str]:
    setting, problem = own.setting, own.problem
    edges: dict[str, list[str]] = {}
    options: dict[str, list[str]] = {}

    def add(name: str, ref: Referent, owner: str) -> bool:
        if ref.kind == "thing":
            if supports_of(edges, ref.owner, name):
                return False
            edges.setdefault(name, []).append(ref.owner)
        if (
            name in movers
            and ref.kind == "region"
            and not any(one not in setting.used or setting.used[one].board for one in ref.surfaces)
        ):
            return True  # a part of the ground
        own_options = options.setdefault(name, [])
        own_options.extend(one for one in ref.surfaces if one not in own_options)
        return True

    initial = {_names(fact) for fact in problem.init}
    movers = {name for name, _, _ in own.wanted} | {pair[0] for pair in own.unwanted if pair in initial}
    for name in movers:
        options[name] = ["workspace"]
    for name, ref, owner in own.wanted:
        if not add(name, ref, owner):
            own.lost.append(f"never drawn, as things cannot stand on each other in a circle: {name} on {owner}")
    start: list[str] = []
    require: list[str] = []
    comments: dict[str, list[str]] = {}
    start_lines: list[str] = []
    for fact in problem.init:
        _initial(own, fact, movers, add, start, require, comments, start_lines)
    grounds = [one for one in setting.grounds if any(one in names for _, names in own.formulas)]
    if len(grounds) > 1:
        own.lost.append(f"without geometry, as the ground is one: that {' and '.join(grounds)} are apart")
    setting.fill()
    left, bottom, right, top = setting.space
    title = problem.language or problem.name or problem.source.name
    lines = [f"# {title}", f"# From {_clean(problem.source.name)}; metres, in its own frame."]
    lines += [f"# {_clean(one)}" for one in own.lost]
    lines += [f"# without geometry: {_clean(name)} has no body" for name in setting.without]
    lines += [f"# not read, {own.line(one)}" for one in problem.other]
    lines += ["", f"workspace [{left:g}, {right:g}] x [{bottom:g}, {top:g}]", ""]
    for name, area in setting.used.items():
        lines.append(area.text + (f"  # {setting.notes[name]}" if name in setting.notes else ""))
    lines.append("")
    for name, made in setting.furniture.items():
        note = f"# {setting.ids[name]}: {setting.notes.get(name, 'nothing says where it is: it stands in a row')}"
        lines.append(note)
        if made.body is not None:
            x, y, turn = setting.poses.get(name, (0.0, 0.0, 0.0))
            size = ", ".join(f"{one:g}" for one in made.body)
            lines.append(f"object {setting.ids[name]} = box({size}) at ({x:g}, {y:g}, {math.degrees(turn):.6g} deg)")
    for name, shape in setting.shapes.items():
        place = options.get(name, [])
        on = "" if not place or place == ["workspace"] else f" on {place[0]}"
        if len(place) > 1:
            on = f" on any of [{', '.join(place)}]"
        thing = problem.things[name]
        line = thing.node.span.source.position(thing.node.span.start)[0]
        lines += [f"# {one}" for one in comments.get(name, ())]
        if name in setting.notes:
            lines.append(f"# {setting.notes[name]}")
        lines.append(f"object {setting.ids[name]} = {shape}{on}  # line {line}: {name} - {thing.kind}")
    lines += ["", "# no two bodies share space: those that could meet", *collisions(setting, options), *require, ""]
    everywhere = {setting.ids[name] for name in movers if options[name] == ["workspace"]}
    low = [re.fullmatch(r"\(*z\((\w+)\) <= EPS_LEVEL\)*", one) for one in start]
    if all(one is not None and one[1] in everywhere for one in low):
        lines += ["# every scene is a start", ""] if start else []
    else:
        lines += [*(f"# {one}" for one in start_lines), f"start: {' & '.join(start)}", ""]
    lines += [*(f"# {one}" for one in goal_lines), f"goal: {goal}"]
    return lines


def _initial(
    own: _Compiler,
    fact: Node,
    movers: set[str],
    add: object,
    start: list[str],
    require: list[str],
    comments: dict[str, list[str]],
    start_lines: list[str],
) -> None:
    """One initial fact: what carries a thing that stays, or a part of `start`."""
    assert callable(add)
    setting, problem = own.setting, own.problem
    names = _names(fact)
    name = names[0] if names else ""
    head = fact.head if isinstance(fact, SExprList) else ""
    held = len(names) == 2 and name in setting.furniture and name in setting.poses
    if held and (own.predicate_formula(head) or PredicateFormula(0)).holds:
        own.arities[plain(head)] = 2
        setting.notes.setdefault(name, f"{own.line(fact)}, in a row")
        return
    own.comments, before = [], len(own.wanted)
    meaning = GoalReader(problem, own.atom, own.lose).read(fact, {})
    new = own.wanted[before:]
    del own.wanted[before:]
    if meaning.text is None or meaning.text == "true":
        return
    if meaning.text == "false":
        own.lost.append(f"not kept, as it cannot hold, {own.line(fact)}")
        return
    texts, place = [meaning.text], problem.regions.get(names[-1]) if names else None
    if len(new) == 1 and place is not None and place.yaw and name in setting.shapes:
        low, high = place.yaw[0]
        half = max(abs(high - low) / 2, MIN_HEADING_TOLERANCE)
        if half < math.pi and not isinstance(shape_from(setting.shapes[name]).footprint, Circle):
            middle = math.degrees((low + high) / 2)
            texts.append(f"angle({setting.ids[name]}, {middle:.6g} deg, {math.degrees(half):.6g} deg)")
    if len(new) == 1 and add(*new[0]):
        if name not in movers:
            comments.setdefault(name, []).append(own.line(fact))
            require += [f"require {one}  # {own.line(fact)}" for one in texts[1:]]
            return
        start += texts
        start_lines.append(own.line(fact))
    elif new:
        own.lost.append(f"not kept, as things cannot stand on each other in a circle, {own.line(fact)}")
    elif set(re.findall(r"\w+", meaning.text)) & {*(setting.ids[one] for one in movers), *(OVER_ALL if movers else ())}:
        start += [f"({meaning.text})"]
        start_lines.append(own.line(fact))
    else:
        require.append(f"require {meaning.text}  # {own.line(fact)}")


def _names(fact: Node) -> tuple[str, ...]:
    """The arguments of a fact about things; none for any other."""
    found = tuple(one.text for one in fact.rest if isinstance(one, SExprAtom)) if isinstance(fact, SExprList) else ()
    return found if isinstance(fact, SExprList) and len(found) == len(fact.rest) else ()


def _clean(text: str) -> str:
    return " ".join("".join(char if char.isprintable() else " " for char in text).split())
