"""A problem -> the text of a spec, formatted.

What the goal moves can be anywhere on the ground, where the goal has it, or on what it starts on; where it starts is
the label `start`. Everything else stays where it starts.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field

from scenegen.errors import DataError, Diagnostic, Source, SpecError
from scenegen.errors.names import nearest
from scenegen.errors.planning import (
    FACTS_MEAN_NOTHING,
    IMPORT_FAILS,
    MAP_NAMES_NOTHING,
    NO_SPATIAL_GOAL,
    PDDL_FORM,
    UNKNOWN_PREDICATE,
)
from scenegen.lang.check import check_text
from scenegen.lang.layout import format_source
from scenegen.pddl.collisions import collisions
from scenegen.pddl.goal import Goal, Meaning
from scenegen.pddl.mapping import Map
from scenegen.pddl.problem import Problem
from scenegen.pddl.read import Group, Node
from scenegen.pddl.setting import Ref, Setting, shape_from, supports_of
from scenegen.pddl.tables import COMMON, LIBERO, Relation, plain, relation
from scenegen.primitives import Circle

LONGEST = 100  # characters of the source in a comment
OVER_ALL = ("reachableFromAbove", "others", "objects", "load", "stable", "noOverlap", "noCollision")  # take all things
TURN = math.radians(5.0)  # the least tolerance of a heading that a region gives


@dataclass(frozen=True, slots=True)
class Reading:
    """How a problem was read: what became of its things, and the formula of each fact that it mentions, by predicate
    and names. `known` says what a predicate means."""

    problem: Problem
    setting: Setting
    formulas: Mapping[tuple[str, tuple[str, ...]], str]
    known: Callable[[str], Relation | None]


@dataclass(frozen=True, slots=True)
class Imported:
    """A spec's text, with what of the problem is not in it: facts and parts of the goal without geometry."""

    text: str
    lost: tuple[str, ...]
    warnings: tuple[Diagnostic, ...]
    reading: Reading = field(repr=False, compare=False)


@dataclass(slots=True)
class _Compiler:
    problem: Problem
    setting: Setting
    table: Map
    lost: list[str] = field(default_factory=list)
    told: dict[str, Diagnostic] = field(default_factory=dict)
    said: list[str] = field(default_factory=list)  # comments of the formula being read
    wanted: list[tuple[str, Ref, str]] = field(default_factory=list)  # mover, carrier, its name
    unwanted: list[tuple[str, str]] = field(default_factory=list)  # a thing, and what it is not to be on
    met: set[str] = field(default_factory=set)  # predicates of the problem
    tried: dict[str, int] = field(default_factory=dict)  # those of them that the map has, and their arguments
    formulas: dict[tuple[str, tuple[str, ...]], str] = field(default_factory=dict)

    def line(self, node: Node) -> str:
        text = " ".join(node.span.text.split())
        if len(text) > LONGEST:
            text = f"{text[: LONGEST - 3]}..."
        return f"line {self.problem.source.position(node.span.start)[0]}: {text}"

    def lose(self, node: Node) -> Meaning:
        line = f"without geometry, {self.line(node)}"
        if line not in self.lost:
            self.lost.append(line)
        return Meaning(None, whole=False)

    def known(self, name: str) -> Relation | None:
        mapped = {plain(key): value for key, value in self.table.predicates.items()}
        name = plain(name)
        if name in mapped:
            return relation(mapped[name])
        return (LIBERO.get(name) if self.problem.regions else None) or COMMON.get(name)

    def atom(self, node: Group, names: Sequence[str], wanted: bool) -> Meaning:
        self.met.add(plain(node.head))
        found = self.known(node.head)
        if found is None:
            close = nearest(plain(node.head), {*LIBERO, *COMMON})
            key = node.head if re.fullmatch(r"[\w-]+", node.head) else f'"{node.head}"'
            near = [close] if close else []
            self.told.setdefault(node.head, UNKNOWN_PREDICATE(node.span, name=node.head, key=key, near=near))
        self._mapped(node.head, len(names))
        arity = self.problem.domain.predicates.get(node.head, None if found is None else found.arity)
        if arity is not None and 0 <= arity != len(names):
            raise DataError(PDDL_FORM(node.span, wanted=f"a fact of `{node.head}`", reason=f"it takes {arity}"))
        if found is None or (not found.formula and not found.holds):
            return self.lose(node)
        if any(name in self.setting.without for name in names):
            return self.lose(node)
        refs = [self.setting.resolve(name, part) for name, part in zip(names, node.rest, strict=True)]
        self.said.append(self.line(node))
        if found.holds:
            if refs[0].kind != "thing":
                return self.lose(node)
            if wanted:
                self.wanted.append((names[0], refs[1], names[1]))
            else:
                self.unwanted.append((names[0], names[1]))
            text = self.held(found, names, refs)
        else:
            text = filled(found.formula, [one.argument for one in refs])
        self.formulas.setdefault((node.items[0].span.text, tuple(names)), text)
        return Meaning(text)

    def _mapped(self, name: str, count: int) -> None:
        """Refuse a formula of the map that has not the arguments of the predicate's facts. Raises DataError."""
        key = next((one for one in self.table.predicates if plain(one) == plain(name)), None)
        if key is None or not relation(self.table.predicates[key]).formula:
            return
        formula = self.table.predicates[key]
        said = {int(one) for one in re.findall(r"\$(\d)", formula)}
        short = max(said, default=0) < count and name not in self.problem.domain.predicates
        if not said or min(said) < 1 or max(said) > count or short:
            named = " and ".join(f"${one}" for one in sorted(said)) or "none"
            reason = f"{count} arguments in a fact, and the formula names {named}"
            raise DataError(FACTS_MEAN_NOTHING(formula=formula, name=key, reason=reason))
        self.tried[key] = count

    def held(self, found: Relation, names: Sequence[str], refs: Sequence[Ref]) -> str:
        upper, lower = refs[0].argument, refs[1]
        if lower.kind != "thing":
            return resting(upper, lower)
        owner = next(one for one, made in self.setting.ids.items() if made == lower.argument)
        if owner == names[0]:
            return "false"
        return carried(found, upper, lower.argument, self.setting.carries(names[0], owner, inside=found.holds == "in"))


def filled(formula: str, arguments: Sequence[str]) -> str:
    """A relation's formula with its arguments, in parentheses."""
    text = re.sub(
        r"\$(\d)", lambda one: arguments[int(one[1]) - 1] if 1 <= int(one[1]) <= len(arguments) else one[0], formula
    )
    return text if text.startswith("(") else f"({text})"


def resting(upper: str, lower: Ref) -> str:
    """That a thing stands on the ground, or on a region."""
    if lower.kind == "ground":
        return f"z({upper}) <= EPS_LEVEL"
    parts = [f"restsOn({upper}, {one})" for one in lower.surfaces]
    return parts[0] if len(parts) == 1 else f"({' | '.join(parts)})"


def carried(found: Relation, upper: str, lower: str, off: float) -> str:
    """That one thing carries another, whose height may be `off` by so many metres."""
    if found.holds == "in":
        return f"insideOf({upper}, {lower})"
    more = "" if off <= 0.001 else f", {math.ceil(off * 1000)} mm"
    text = f"restsOn({upper}, {lower}{more})"
    return text if found.near is None else f"({text} & dist({upper}, {lower}) <= {found.near:g} m)"


def compile_problem(problem: Problem, table: Map) -> Imported:
    """Raises DataError for kinds, names and goals that mean nothing here, and for a spec that does not check."""
    setting = Setting(problem, table)
    setting.classify()
    own = _Compiler(problem, setting, table)
    for fact in problem.init:  # furniture is held first: where its boards are follows
        if isinstance(fact, Group) and len(fact.rest) == 2 and plain(fact.head) in ("on", "ontop"):
            name, region = (one.span.text for one in fact.rest)
            if name in setting.furniture and region in problem.regions and problem.regions[region].ranges:
                setting.place(name, problem.regions[region])
                setting.notes[name] = f"{own.line(fact)}, held in the middle"
    assert problem.goal is not None
    meaning = Goal(problem, own.atom).read(problem.goal, {})
    goal_lines, own.said = own.said, []
    if meaning.text is None:
        missing = sorted(own.met)
        key = missing[0] if missing else "NAME"
        raise DataError(NO_SPATIAL_GOAL(problem.goal.span, file=problem.source.name, missing=missing, key=key))
    lines = _written(own, meaning.text, list(dict.fromkeys(goal_lines)))
    _refuse_unused(own)
    text = "\n".join(lines) + "\n"
    try:
        text = format_source(Source(problem.source.name, text))
        check_text(text, problem.source.name)
    except SpecError as error:
        _refuse_formulas(own)
        first = error.diagnostics[0]
        same = "the goal holds in every scene or in none, whatever the sizes: ask for less, or for more"
        advice = same if first.code == "constant-label" else None
        raise DataError(IMPORT_FAILS(file=problem.source.name, reason=first.title, advice=advice)) from None
    reading = Reading(problem, setting, own.formulas, own.known)
    return Imported(text, tuple(own.lost), tuple(own.told.values()), reading)


def _refuse_formulas(own: _Compiler) -> None:
    """Refuse what the map makes of a predicate where it is no formula about things. Raises DataError."""
    for name, count in own.tried.items():
        things = [f"thing_{number}" for number in range(1, count + 1)]
        formula = own.table.predicates[name]
        try:
            check_text(f"object {', '.join(things)}\ngoal: {filled(formula, things)}\n")
        except SpecError as error:
            first = error.diagnostics[0]
            if first.code != "constant-label":
                raise DataError(FACTS_MEAN_NOTHING(formula=formula, name=name, reason=first.title)) from None


def _refuse_unused(own: _Compiler) -> None:
    """A map names only what there is."""
    kinds = {name for one, (kind, _) in own.problem.things.items() for name in (one, kind, kind.split(".")[0])}
    for name in own.table.objects:
        if name not in kinds:
            raise DataError(MAP_NAMES_NOTHING(file="the map", name=name, known=kinds))
    for name in own.table.predicates:
        if plain(name) not in own.met and name.lower() not in own.problem.domain.predicates:
            raise DataError(MAP_NAMES_NOTHING(file="the map", name=name, known=own.met))


def _written(own: _Compiler, goal: str, goal_lines: Sequence[str]) -> list[str]:
    setting, problem = own.setting, own.problem
    edges: dict[str, list[str]] = {}
    options: dict[str, list[str]] = {}

    def add(name: str, ref: Ref, owner: str) -> bool:
        if ref.kind == "thing":
            below = next(one for one, made in setting.ids.items() if made == ref.argument)
            if supports_of(edges, below, name):
                return False
            edges.setdefault(name, []).append(below)
        if (
            name in movers
            and ref.kind == "region"
            and not any(" at " in setting.used.get(one, " at ") for one in ref.surfaces)
        ):
            return True  # a part of the ground
        own_options = options.setdefault(name, [])
        own_options.extend(one for one in ref.surfaces if one not in own_options)
        return True

    initial = {tuple(one.span.text for one in fact.rest) for fact in problem.init if isinstance(fact, Group)}
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
    setting.fill()
    left, bottom, right, top = setting.space
    title = problem.language or problem.name or problem.source.name
    lines = [f"# {title}", f"# From {_clean(problem.source.name)}; metres, in its own frame."]
    lines += [f"# {_clean(one)}" for one in own.lost]
    lines += [f"# without geometry: {_clean(name)} has no body" for name in setting.without]
    lines += [f"# not read, {own.line(one)}" for one in problem.other]
    lines += ["", f"workspace [{left:g}, {right:g}] x [{bottom:g}, {top:g}]", ""]
    for name, text in setting.used.items():
        lines.append(text + (f"  # {setting.notes[name]}" if name in setting.notes else ""))
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
        node = problem.things[name][1]
        line = problem.source.position(node.span.start)[0]
        lines += [f"# {one}" for one in comments.get(name, ())]
        if name in setting.notes:
            lines.append(f"# {setting.notes[name]}")
        lines.append(f"object {setting.ids[name]} = {shape}{on}  # line {line}: {name} - {problem.things[name][0]}")
    lines += ["", "# no two bodies share space: those that could meet", *collisions(setting, options), *require, ""]
    if start:
        lines += [*(f"# {one}" for one in start_lines), f"start: {' & '.join(start)}", ""]
    lines += [*(f"# {one}" for one in goal_lines), f"goal: {_bare(goal)}"]
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
    if isinstance(fact, Group) and fact.head in ("=", "increase"):
        own.lose(fact)
        return
    if isinstance(fact, Group) and fact.rest and fact.rest[0].span.text in setting.furniture:
        name = fact.rest[0].span.text
        if name in setting.poses and len(fact.rest) == 2 and (own.known(fact.head) or Relation(0)).holds:
            own.met.add(plain(fact.head))
            setting.notes.setdefault(name, f"{own.line(fact)}, in a row")
            return
    own.said, before = [], len(own.wanted)
    meaning = Goal(problem, own.atom).read(fact, {})
    new = own.wanted[before:]
    del own.wanted[before:]
    if meaning.text is None:
        return
    name = fact.rest[0].span.text if isinstance(fact, Group) and fact.rest else ""
    texts, place = [meaning.text], problem.regions.get(fact.rest[-1].span.text) if isinstance(fact, Group) else None
    if len(new) == 1 and place is not None and place.yaw and name in setting.shapes:
        low, high = place.yaw[0]
        half = max(abs(high - low) / 2, TURN)
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
        require.append(f"require {_bare(meaning.text)}  # {own.line(fact)}")


def _bare(text: str) -> str:
    return text


def _clean(text: str) -> str:
    return " ".join("".join(char if char.isprintable() else " " for char in text).split())
