"""Mistakes that people bring from other languages, from mathematics and from word processors.

Each is recognised by the text around the place where the parser stopped, and answered with what to write instead. The
general explanations are in scenegen.lang.syntax.syntax_errors.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence

from scenegen.errors import Diagnostic, Source, Span
from scenegen.errors.language import (
    CANNOT_BE_SAID,
    FOREIGN_SIGN,
    INFIX_RELATION,
    MISSING_SIGN,
    NESTED_ARRAY,
    NOTHING_BESIDE,
    OBJECTS_WITHOUT_NAMES,
    UNEXPECTED,
    UNKNOWN_RELATION,
    UNKNOWN_UNIT,
)
from scenegen.geometry import PRIMITIVES
from scenegen.lang.syntax.tokens import ending
from scenegen.pose import NAMES
from scenegen.things.library import COLOR_WORDS

THE_TABLE = "the table is called `workspace`; things stand on it if nothing is declared"
TABLE_WORDS = ("table", "tabletop", "floor", "ground", "desk", "countertop", "surface", "world")

SAYS_MORE = "`scenegen explain not-here` says more"
PRIOR = (
    "a statement says where a thing usually is: usually mug ~ normal((0.4, 0.3), 5 cm), uniform(left), a mixture of "
    "these, or recorded poses; `scenegen explain priors` says more"
)
CAMERA_HELP = (
    "declare a camera, camera front = at (0.5, -0.6, 0.7) looks at (0.5, 0.4, 0) fov 60 deg, 4:3, and write "
    "visible({a}, front, 30 %), unhidden({a}, front) or inView({a}, front)"
)
ON_HELP = "write restsOn({a}, {b}); what {a} stands on is declared: object {a} on {b}"
UNDER = "write underneath({a}, {b}); `belowOf` is along y"
OVER_HELP = "if it stands on it, write restsOn({a}, {b}), else z({a}) >= top({b}); `aboveOf` is along y"
SIZES_HELP = "sizes are constants: `scenegen check` lists them; in a formula write height({a}) or reach({a}, EAST)"
COLOR = (
    f'a plain shape has a colour: box(10 cm, 6 cm, 4 cm, color = "red"); of other objects looks change it; {SAYS_MORE}'
)
BODY_HELP = f"a spec says where things stand; mass and friction are those of the library or of an index; {SAYS_MORE}"
LYING = f"objects stand upright, and turn about the vertical alone; {SAYS_MORE}"
MATHS = "of functions there are abs, min, max, sum, mean, sin, cos and wrap; for a power write a product: a * a"
STATE = f"a spec says where things stand, not the state that they are in; {SAYS_MORE}"
OPEN_HELP = "how far a drawer is open is declared: object cabinet = cabinet(3, open = [0.5, 0, 0]); it does not change"
WAY = "of hands from above write reachableFromAbove({a}); of what stands around it gap({a}, {b}) >= 5 cm"
COUNTING = f"formulas do not count; for two or more write exists p, q in list: ...; {SAYS_MORE}"

# Names in small letters without `_` -> what to write for a relation of {a} and {b}.
_RELATIONS = {
    ("near", "close", "closeby", "nearby", "proximity", "closetogether", "isnear", "isclose", "isclosetogether"):
        "write closeTo({a}, {b}, 20 cm)",
    ("nextto", "beside", "besides", "adjacent", "adjacentto", "alongside", "sidebyside", "by"):
        "write alignedY({a}, {b}) & closeTo({a}, {b}, 20 cm)",
    ("behind", "inbackof", "backof", "northof", "fartherthan", "beyond"):
        "write aboveOf({a}, {b}): further from the viewer",
    ("infrontof", "infront", "frontof", "front", "before", "aheadof", "ahead", "southof"):
        "write belowOf({a}, {b}): nearer to the viewer",
    ("left", "leftof", "onleft", "onleftof", "toleftof", "onleftsideof", "leftside", "westof", "lefter"):
        "write leftOf({a}, {b})",
    ("right", "rightof", "onright", "onrightof", "torightof", "onrightsideof", "rightside", "eastof"):
        "write rightOf({a}, {b})",
    ("distance", "dist", "distanceto", "distancebetween", "euclidean", "euclideandistance", "norm"):
        "write dist({a}, {b})",
    ("far", "faraway", "farfrom", "awayfrom", "farawayfrom", "distant", "distantfrom"):
        "write farFrom({a}, {b}, 30 cm)",
    ("touch", "touches", "contact", "incontact", "incontactwith", "contacts"): "write touching({a}, {b})",
    ("contains", "contain", "containing", "holds", "encloses", "surrounds"): "write inside({b}, {a})",
    ("overlap", "overlapping", "intersect", "intersects", "intersection", "collide", "collides", "collision",
     "incollision", "colliding"): "write overlaps({a}, {b})",
    ("collisionfree", "nocollisions", "notcolliding", "disjoint", "separated", "separate", "nonoverlapping",
     "notoverlapping", "nointersection", "nooverlaps"):
        "write noCollision() of all bodies, noOverlap() of all footprints, clearOf(p, q) of two things",
    ("clearance", "separation"): "write gap({a}, {b})",
    ("parallel", "parallelto", "isparallel"):
        "write abs(sin(theta({a}) - theta({b}))) <= 0.1; sameHeading({a}, {b}) where both point the same way",
    ("perpendicular", "perpendicularto", "orthogonal", "orthogonalto"):
        "write abs(cos(theta({a}) - theta({b}))) <= 0.1",
    ("aligned", "align", "alignedwith", "inline", "inlinewith", "collinear", "colinear"):
        "write alignedX({a}, {b}) for the same x, alignedY({a}, {b}) for the same y",
    ("inrow", "row", "inaline", "inarow", "line", "sorted"):
        "write ordered([{a}, {b}, ...]) & alignedY({a}, {b})",
    ("centered", "centred", "centeredon", "incenter", "centerof", "inmiddleof", "middle", "incenterof"):
        "write closeTo({a}, workspace.center, 5 cm)",
    ("orientation", "heading", "yaw", "rotation", "rot", "angleof", "direction", "facingangle"):
        "write theta({a}), or angle({a}, NORTH) for a heading within 0.2 rad",
    ("oriented", "pointing", "points"): "write angle({a}, NORTH), or facing({a}, {b})",
    ("position", "pos", "location", "xpos", "xy", "coordinates"): "write x({a}) and y({a})",
    ("faces", "lookat", "lookingat", "looksat", "pointsat", "pointingat", "facingtoward", "facingtowards",
     "pointstowards", "towards", "toward", "face"): "write facing({a}, {b})",
    ("above", "over"): OVER_HELP,
    ("below", "under", "beneath", "underneathof"): UNDER,
    ("ontop", "ontopof", "atop", "upon", "restingon", "restson", "rests", "standson", "standingon", "lieson", "ison",
     "supportedby", "onto", "placedon"): ON_HELP,
    ("ontable", "onthetable"): "write z({a}) <= 0 m; what nothing is declared for stands on the table",
    ("supports", "carries"): "write restsOn({b}, {a}); what {b} stands on is declared: object {b} on {a}",
    ("into", "within", "isin", "inof", "isinside", "containedin", "containedby", "inside", "inregion"):
        "write insideOf({a}, {b}); of a region inside({a}, {b})",
    ("corner", "atcorner", "incorners"): "write inCorner({a})",
    ("edge", "atedge", "border", "atborder", "nearborder", "onedge"): "write nearEdge({a})",
    ("unstable", "balanced", "isstable", "stability"): "write stable([{a}]), or !stable([{a}])",
    ("facingeachother",): "write facing({a}, {b}) & facing({b}, {a})",
    ("size", "width", "length", "radius", "depth", "extent", "diameter", "area", "volume", "dimensions"): SIZES_HELP,
    ("equal", "equals", "eq", "same", "approx", "approximately", "isequal"):
        "allow a tolerance: abs(x({a}) - x({b})) <= 1 cm; for the same place closeTo({a}, {b}, 1 cm)",
    ("if", "ifthen", "ifthenelse", "ite", "iff", "xor", "nand", "when", "unless"):
        "write condition -> consequence; `iff` is (a -> b) & (b -> a)",
    ("sqrt", "pow", "square", "exp", "log", "tan", "asin", "acos", "atan", "floor", "ceil", "round", "mod", "sign"):
        MATHS,
    ("atan2",): "write bearing({a}, {b}): the direction of {b} seen from {a}",
    ("count", "counts", "number", "atleast", "atmost", "exactly", "howmany", "len"): COUNTING,
    ("blocked", "isblocked", "blocks", "blockedby", "obstructed", "isobstructed", "obstructs", "obstructedby",
     "unobstructed", "unblocked", "accessible", "isaccessible", "inaccessible", "free", "isfree", "clear", "isclear",
     "uncovered", "covered", "iscovered", "coveredby"): f"write what is meant: {WAY}",
    # what cannot be said
    ("open", "opened", "isopen", "closed", "isclosed", "shut", "ajar", "openness", "joint", "articulated"): OPEN_HELP,
    ("clean", "dirty", "dusty", "stained", "soaked", "wet", "dry", "hot", "cold", "warm", "cooked", "burnt", "frozen",
     "sliced", "cut", "broken", "full", "empty", "filled", "toggledon", "toggled", "switchedon", "turnedon",
     "poweredon", "folded", "unfolded", "attached", "held", "holding", "handempty", "carrying", "ingripper",
     "temperature", "state"):
        STATE,
    ("normal", "gaussian", "uniform", "truncatednormal", "truncnorm", "lognormal", "beta", "gamma", "exponential",
     "poisson", "discrete", "discreterange", "categorical", "bernoulli", "random", "rand", "randint", "randn",
     "choice", "options", "weighted", "weights", "sample", "prior", "prob", "probability", "distribution",
     "mixture", "range", "density", "likelihood", "resample"): PRIOR,
    ("visible", "isvisible", "visiblefrom", "invisible", "occluded", "occludes", "occlusion", "isoccluded",
     "occludedby", "hidden", "hides", "inview", "infov", "cansee", "sees", "lineofsight", "visibility", "camera",
     "cameras", "view", "viewpoint", "notvisible", "visibleregion"): CAMERA_HELP,
    ("isreachable", "inreach", "withinreach", "reachablefrom", "canreach", "reaches", "kinematic", "ik"):
        "declare the robot and write reachable({a}, arm): robot arm = panda at (0.5, -0.25, NORTH)",
    ("isgraspable", "grasp", "cangrasp", "grasped", "pickable", "grippable"):
        "declare the robot and write graspable({a}, arm): robot arm = panda at (0.5, -0.25, NORTH)",
    ("color", "colour", "colors", "hue", "rgb", "rgba", "texture", "material", "shade"): COLOR,
    ("mass", "weight", "friction", "density", "inertia", "velocity", "force", "physics"): BODY_HELP,
    ("upright", "standing", "lying", "tilted", "tilt", "roll", "pitch", "upsidedown", "flipped", "onside", "isupright",
     "fallen", "toppled"): LYING,
    ("light", "lighting", "lamp", "brightness", "background", "randomize", "augment", "augmentation", "domain"):
        f"pictures have looks, no spec has: see `scenegen explain pictures`; {SAYS_MORE}",
    ("seed", "samples", "scenes", "timeout"): "an option of `scenegen sample` says how many scenes, and which seed",
    ("robot", "gripper", "arm"): "a robot is declared: robot arm = panda at (0.5, -0.25, NORTH)",
    ("ego", "agent", "mutate", "behavior", "scenario", "model"):
        f"a spec is about things on a table, without what robots do, or scenarios; {SAYS_MORE}",
}  # fmt: skip
RELATIONS = {name: instead for names, instead in _RELATIONS.items() for name in names}

SIGNS = {  # operators and terms that are no keywords
    "~": PRIOR,
    "=": "write abs(a - b) <= 1 cm for two numbers, !(a != b) for two things; `=` only stands in statements",
    "==": "write abs(a - b) <= 1 cm for two numbers, !(a != b) for two things",
    "!=": "a != b says that two things, or two numbers of a round, differ",
    "!": "not: !a has phi of minus a",
    "&": "and: phi of a & b is the smaller one of the two",
    "|": "or: phi of a | b is the larger one of the two",
    "->": "implies: a -> b is !a | b",
    "<=": "a <= b has phi of b - a, in the unit of both; `<` is the same",
    ">=": "a >= b has phi of a - b, in the unit of both; `>` is the same",
    ":": "name: formula makes a label; scenes are sampled at a range of its phi",
    "phi": "how far a scene is from the border of a formula: 0 or more where it holds, in metres or radians",
    "robustness": "see phi: `scenegen explain phi`",
    "label": "a formula with a name, as in task: leftOf(a, b); scenes are sampled at a range of its phi",
    "always": "always FORMULA: at every moment from now; needs `time`",
    "eventually": "eventually FORMULA: at some moment from now; needs `time`",
    "until": "a until b: a holds up to a moment at which b does; needs `time`",
    "mirror": "mirrored(...) is a relation; scenes.mirrored() and `scenegen export` make mirrored copies",
}
INFIX = {
    "on": ON_HELP,
    "in": "write insideOf({a}, {b}); what {a} stands in is declared: object {a} on {b}",
}
DECLARED = (  # instead of `on`
    *("in", "into", "inside", "within", "onto", "atop", "upon", "over", "above"),
    *("ontop", "ontopof", "restingon", "standson", "supportedby", "containedin"),
)
FILLERS = ("is", "are", "be", "must", "should", "the", "to", "a", "an", "stands", "lies", "placed", "located")

OVER_A_HEIGHT = {  # of a and a height b
    **dict.fromkeys(("above", "over"), "write z({a}) >= {b}, of the lowest point of {a}"),
    **dict.fromkeys(("below", "under", "beneath"), "write top({a}) <= {b}, of the highest point of {a}"),
}


def plain(word: str) -> str:
    """A name however it is written: `in_front_of`, `InFrontOf` and `inFrontOf` are `infrontof`."""
    return word.replace("_", "").replace("-", "").casefold()


def one_list(text: str) -> str | None:
    """The members of a list in which there are lists, as one list without its brackets; None where it is not closed.
    `text` begins with the bracket, and may go on after the list."""
    kept, opened = "", list[bool]()  # whether each open bracket is one of an index, as in shelf[1]
    for place, char in enumerate(text):
        if char == "[":
            opened.append(re.match(r"\w", text[place - 1 : place]) is not None)
            kept += char if opened[-1] else ""
        elif char == "]":
            kept += char if opened.pop() else ""
            if not opened:
                return " ".join(re.sub(r"\bany\s+of\b", "", kept).split())
        else:
            kept += char
    return None


def of_thing(name: str) -> str | None:
    """What to write instead of a thing that there is not; None of unknown names."""
    return THE_TABLE if plain(name) in TABLE_WORDS else None


def of_number(name: str) -> str | None:
    """What to write instead of a constant that there is not; None of unknown names."""
    return PRIOR if RELATIONS.get(plain(name)) == PRIOR else None


def of_relation(name: str, arguments: Sequence[str], known_names: Iterable[str] = ()) -> str | None:
    """What to write instead of a call of a relation or function that there is not; None of unknown names, and of those
    that are nearly one of the known names: `left_of`."""
    word = plain(name)
    if any(plain(one) == word for one in known_names):
        return None
    if word not in RELATIONS:
        word = known_phrase(re.findall(r"[A-Z]+(?![a-z])|[A-Z]?[a-z]+", name)) or ""  # to_the_left_of, isOn
        if word not in RELATIONS:
            return None
    a, b, *_ = (*arguments, "a", "b") if len(arguments) != 1 else (arguments[0], "b")
    of_number, to_number = (re.match(r"[\d.]", one) for one in (a, b))
    if word in OVER_A_HEIGHT and of_number:
        return None
    return (OVER_A_HEIGHT if word in OVER_A_HEIGHT and to_number else RELATIONS)[word].format(a=a, b=b)


def known_phrase(words: Sequence[str]) -> str | None:
    """The name in RELATIONS or INFIX that some words of a sentence are: `nextto` for `is next to`; None of others."""
    kept = list(words)
    while kept and kept[0].lower() in FILLERS:
        kept.pop(0)
    names = plain("".join(kept)), plain("".join(one for one in kept if one.lower() not in FILLERS))
    return next((name for name in names if name in RELATIONS or name in INFIX), None)


def write_instead(first: str, words: Sequence[str], second: str, *, declared: bool) -> str | None:
    """What to write instead of `first words second`, in an object statement or in a formula; None of other words."""
    name = known_phrase(words) or plain("".join(words))
    if name == "is" and plain(second) in RELATIONS:  # `mug is clean`
        return RELATIONS[plain(second)].format(a=first, b="b")
    if declared and name in DECLARED:
        return f"write `{first} on {second}`"
    table = RELATIONS | INFIX
    if name not in table:
        return None
    if not declared and name in ("on", *DECLARED) and second.lower() in TABLE_WORDS:
        return f"things stand on the table if nothing is declared: leave this out, or write restsOn({first}, workspace)"
    if not declared and name == "on" and second == "any":
        return f"a choice is declared, object {first} on any of [...]; each surface is asked for with restsOn"
    return ("in a formula " if declared and table[name].startswith("write") else "") + table[name].format(
        a=first, b=second
    )


NAME = r"[A-Za-z_][\w.]*(?:\[[^\[\]\n]*\])?"  # of a thing, an element or a surface
UNIT_WORDS = ("m", "cm", "mm", "rad", "deg", "turn")

# characters of word processors and of other alphabets -> what to type instead
INCHES = {"in": 2.54, "inch": 2.54, "inches": 2.54, "ft": 30.48, "foot": 30.48, "feet": 30.48}  # in cm

_QUOTES = "write names without quotes; file names in straight ones"
LOOKALIKES = {  # what they are, and what to write
    "°": ("not a unit", "write 90 deg"),
    "“": ("a typographic quote", _QUOTES),
    "”": ("a typographic quote", _QUOTES),
    "‘": ("a typographic quote", _QUOTES),
    "’": ("a typographic quote", _QUOTES),
    "，": ("a wide comma", "write `,`"),
    "：": ("a wide colon", "write `:`"),
    "（": ("a wide parenthesis", "write `(`"),
    "）": ("a wide parenthesis", "write `)`"),
    "−": ("a typographic minus", "write `-`"),
    "–": ("a dash", "write `-`"),
    "×": ("not a letter", "write `*` for a product, `x` in `workspace [0, 1] x [0, 1]`"),
    "·": ("not an operator here", "write `*` for a product"),
    "′": ("not a unit", "units are m, cm, mm, rad, deg and turn"),
}


def explain_foreign_syntax(source: Source, start: int, end: int, depth: int, accepts: set[str]) -> Diagnostic | None:
    """The diagnostic for a known habit at characters start..end, `depth` brackets deep; None for anything else."""
    text, word = source.text, source.text[start:end]
    here = Span(source, start, end)
    line = text[text.rfind("\n", 0, start) + 1 : start]
    if text[start] in LOOKALIKES:
        what, instead = LOOKALIKES[text[start]]
        return FOREIGN_SIGN(Span(source, start, start + 1), character=text[start], what=what, instead=instead)
    if text[max(0, start - 2) : start + 1] == "<->":
        return FOREIGN_SIGN(Span(source, start - 2, start + 1), operator="<->", instead="(a -> b) & (b -> a)")
    if word == "," and not depth and accepts & {"_AND", "$END"}:
        return FOREIGN_SIGN(here, comma=True)
    if word == "|" and "NAME" in accepts and re.match(r"[^|\n]*\|", text[end:]):
        return NOTHING_BESIDE(here, word="|", instead="for an absolute value write abs(...)")
    if word == "=" and text[end : end + 1] not in ("=", "<", ">"):
        head = re.fullmatch(r"\s*((\w+)\s*\([\w\s,]*\))\s*", line)
        if head is not None and head[2] not in PRIMITIVES and head[2] not in NAMES:
            return MISSING_SIGN(here, head=head[1])
    if word == "[" and ending(r"\bobject\s[^\n:=]*\]\s*$", text[:start]):
        return NESTED_ARRAY(here)
    if word == ":":
        return _colon(source, here, line, depth, accepts)
    if word == "(" and (named := ending(r"\b(?:object|,)\s*([A-Za-z_]\w*)[ \t]*$", line)) and "EQUAL" in accepts:
        if re.match(r"\s*colou?r\b", text[end:]):
            return CANNOT_BE_SAID(here, word="color", instead=COLOR)
        return UNEXPECTED(here, found="`(`", expected="`=` and a shape", instead=f"write object {named[1]} = box(...)")
    if word == "," and depth and (problem := _range(source, here)) is not None:
        return problem
    if re.match(r"\w", word) and "NAME" not in accepts and "COLON" not in accepts:
        problem = _not_here(source, here, line, accepts)
        return problem or (_word(source, here, line, depth) if word.isidentifier() else None)
    if word == "in" and re.match(r"\s*\(", text[end:]):
        instead = "write inside(a, b), or insideOf(a, b) of what stands in a vessel"
        return UNKNOWN_RELATION(here, name="in", instead=instead)
    return None


def _range(source: Source, here: Span) -> Diagnostic | None:
    """Two numbers with `,` or `:` between them where a range or a window stands with something else."""
    found = ending(r"\b(object\s[^\n]*?)?(\w+)\s*\[\s*([\w.]+)\s*$", source.text[: here.start])
    after = re.match(r"\s*([\w.]+)\s*\]", source.text[here.end :])
    if found is None or after is None:
        return None
    name, first, last = found[2], found[3], after[1]
    instead = f"two elements are a list: [{name}[{first}], {name}[{last}]]"
    if found[1]:
        instead = f"for {first} to {last} of them write {name}[{first}..{last}]"
    elif here.text == ":" and name in ("always", "eventually", "until", "until_with"):
        instead = f"write {name} [{first}, {last}]"
    expected = "`,`" if instead.startswith("write") else "`]`"
    return UNEXPECTED(here, found=f"`{here.text}`", expected=expected, instead=instead)


def _not_here(source: Source, here: Span, line: str, accepts: set[str]) -> Diagnostic | None:
    """A property or a statement that other languages have, and this one has not."""
    text, word = source.text, here.text
    before = ending(r"(\w+|\)|\])[ \t]*$", line)
    if word in INCHES and (number := ending(r"(?<![\w.])(\d+(?:\.\d+)?)[ \t]*$", line)) is not None:
        instead = f"{float(number[1]) * INCHES[word]:.4g} cm"
        return UNKNOWN_UNIT(here, name=word, instead=instead)
    if word in UNIT_WORDS and before is not None and before[1] in (")", "]"):
        instead = f"a unit follows each number: [0 {word}, 40 {word}]"
        return UNEXPECTED(here, found=f"`{word}`", expected="no unit", instead=instead)
    if word in ("iff", "xor", "XOR") and "_AND" in accepts:
        instead = "(a -> b) & (b -> a)" if word == "iff" else "(a | b) & !(a & b)"
        return FOREIGN_SIGN(here, operator=word, instead=instead)
    if word == "in" and ending(r"\b(count|number|sum|len)\s*\(\s*\w+\s*$", line):
        return CANNOT_BE_SAID(here, word="count", instead=COUNTING)
    if word == "in" and before is not None and before[1] == ")":
        instead = "for a number write 0.2 <= x(mug) <= 0.4, for a place inside(mug, region)"
        return UNEXPECTED(here, found="`in`", expected="a comparison", instead=instead)
    after = re.match(r"[ \t]+(\w+)", text[here.end :])
    words = [(here.start, here.end)]
    if before is not None and ending(r"\b(?:object|,)\s*\w+[ \t]*$", line) and before[1].lower() in COLOR_WORDS:
        start = here.start - len(before[0])
        return CANNOT_BE_SAID(Span(source, start, start + len(before[1])), word=before[1], instead=COLOR)
    if word in ("with", "has", "having", "at", "of") and after is not None:
        words = [(here.end + after.start(1), here.end + after.end(1))]
    if before is not None and re.fullmatch(r"\s*\w+[ \t]*", line) and before[1] not in ("object", "region"):
        words.append((here.start - len(before[0]), here.start - len(before[0]) + len(before[1])))
    for start, end in words if before is None or before[1] != "by" else ():
        instead = RELATIONS.get(plain(text[start:end]), "write")
        if not instead.startswith(("write", "if ", "allow")):
            said = instead.format(a="mug", b="plate")
            return CANNOT_BE_SAID(Span(source, start, end), word=text[start:end], instead=said)
    return None


def _colon(source: Source, here: Span, line: str, depth: int, accepts: set[str]) -> Diagnostic | None:
    before = ending(r"(\w+)\s*$", line)
    name = before[1] if before else ""
    if depth and (problem := _range(source, here)) is not None:
        return problem
    if name == "workspace":
        return FOREIGN_SIGN(here, workspace=True)
    if depth and ending(r"[(,]\s*\w+\s*$", line):
        return FOREIGN_SIGN(here, name=name)
    if ending(r"\bobject\s+\w+\s*$", source.text[: here.start]):
        return OBJECTS_WITHOUT_NAMES(here)
    comma = source.text[: here.start].rstrip().removesuffix(name).rstrip()
    if comma.endswith(",") and not depth and "\n" in source.text[len(comma) : here.start]:
        return NOTHING_BESIDE(Span(source, len(comma) - 1, len(comma)), word=",", right=True)
    if "EQUAL" in accepts:
        return MISSING_SIGN(here, equal=True)
    return None


def _sides(words: Sequence[str]) -> tuple[str, Sequence[str], str]:
    """The two things of a sentence such as `mug is left of plate`, and what it says of them."""
    # relations are written in camel case, objects hardly ever
    camel = next((place for place, one in enumerate(words[:3]) if re.search(r"[A-Z]", one[1:])), None)
    if camel is None and plain(words[0]) in RELATIONS and plain(words[1]) not in RELATIONS | INFIX:
        camel = 0
    if camel is not None:
        first, second = (one for place, one in enumerate(words[:3]) if place != camel)
        return first, [words[camel]], second
    for end in range(len(words) - 1, 1, -1):  # the longest that is known
        if known_phrase(words[1:end]) is not None:
            return words[0], words[1:end], words[end]
    said = [one for one in words[1:] if one.lower() not in FILLERS]
    return (words[0], said[:1], said[1]) if len(said) > 1 else (words[0], [words[1]], words[2])


def _word(source: Source, here: Span, line: str, depth: int) -> Diagnostic | None:
    """Two words beside each other."""
    text, word = source.text, here.text
    before = ending(rf"({NAME})[ \t]*$", line)
    if before is None:
        return None
    previous = before[1]
    after = re.match(r"[ \t]+([A-Za-z_]\w*)", text[here.end :])
    declared = re.match(r"\s*object\b", line) is not None
    if previous == "import":
        return None
    if word == "of" and after is not None and declared and (on := ending(r"(\S+)\s+on\s+top\s*$", line)) is not None:
        instead = f"write `{on[1]} on {after[1]}`"
        return INFIX_RELATION(here, name="on", first=on[1], second=after[1], instead=instead)
    same = re.match(rf"is[ \t]+(not[ \t]+)?({NAME})(?![ \t]*(?!and\b|or\b|implies\b)[\w.(\[])", text[here.start :])
    if same is not None and not declared and plain(same[2]) not in RELATIONS | INFIX:
        unlike = f"{previous} != {same[2]}"
        instead = f"write {unlike}" if same[1] else f"write !({unlike})"
        return INFIX_RELATION(here, name="is", first=previous, second=same[2], instead=instead)
    if previous == "if":
        return FOREIGN_SIGN(Span(source, here.start - len(before[0]), here.end), word="if")
    if word == "then":
        return FOREIGN_SIGN(here, word="then")
    if word in UNIT_WORDS and previous not in ("object", "const", "region"):
        return UNKNOWN_UNIT(here, name=previous, unit=word)
    if after is not None and after[1] not in ("and", "or", "implies", "in", "at") and not depth:
        phrase = re.match(r"[A-Za-z_]\w*([ \t]+[A-Za-z_]\w*)*", text[here.start :])
        words = [previous, *(phrase[0].split() if phrase else ())]
        if phrase is not None and (more := re.match(r"(?:\.\w+|\[[^\[\]\n]*\])+", text[here.start + phrase.end() :])):
            words[-1] += more[0]  # cabinet.drawer[1]
        first, said, second = _sides(words)
        name = said[0] + "".join(one[:1].upper() + one[1:] for one in said[1:])
        told = write_instead(first, said, second, declared=declared)
        if word == "or" and re.search(rf"\bon[ \t]+{previous}[ \t]*$", line):
            told = f"write on any of [{first}, {second}]"
        return INFIX_RELATION(here, name=name, first=first, second=second, instead=told)
    if re.fullmatch(r"\s*", line[: before.start()]) and re.match(r"\s*\(", text[here.end :]) and not depth:
        return MISSING_SIGN(here, name=previous, formula=f"{word}(...)")
    return None
