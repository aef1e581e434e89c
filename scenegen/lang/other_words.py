"""What people call things in other languages and in everyday life, and what to write for it here."""

from __future__ import annotations

import re
from collections.abc import Sequence

THE_TABLE = "the table is called `workspace`; things stand on it if nothing is declared"
TABLES = ("table", "tabletop", "floor", "ground", "desk", "countertop", "surface", "world")

MORE = "`scenegen explain not-here` says more"
PRIOR = f"places and headings are uniform; for any other distribution weight the scenes afterwards, in Python; {MORE}"
SEEN = f"there is no camera in a spec: draw masks of the scenes and keep those that show enough of it; {MORE}"
ON = "write restsOn({a}, {b}); what {a} stands on is declared: object {a} on {b}"
UNDER = "write underneath({a}, {b}); `belowOf` is along y"
OVER = "if it stands on it, write restsOn({a}, {b}), else z({a}) >= top({b}); `aboveOf` is along y"
SIZES = "sizes are constants: `scenegen check` lists them; in a formula write height({a}) or reach({a}, EAST)"
COLOR = f'a plain shape has a colour: box(10 cm, 6 cm, 4 cm, color = "red"); of other objects looks change it; {MORE}'
BODY = f"a spec says where things stand; mass and friction are those of the library or of an index; {MORE}"
LYING = f"objects stand upright, and turn about the vertical alone; {MORE}"
MATHS = "of functions there are abs, min, max, sum, mean, sin, cos and wrap; for a power write a product: a * a"
STATE = f"a spec says where things stand, not the state that they are in; {MORE}"
OPEN = "how far a drawer is open is declared: object cabinet = cabinet(3, open = [0.5, 0, 0]); it does not change"
WAY = "of hands from above write reachableFromAbove({a}); of what stands around it gap({a}, {b}) >= 5 cm"
COUNTING = f"formulas do not count; for two or more write exists p, q in list: ...; {MORE}"

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
    ("distance", "dist", "distanceto", "distancebetween", "euclidean", "euclideandistance", "norm", "hypot"):
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
    ("above", "over"): OVER,
    ("below", "under", "beneath", "underneathof"): UNDER,
    ("ontop", "ontopof", "atop", "upon", "restingon", "restson", "rests", "standson", "standingon", "lieson", "ison",
     "supportedby", "onto", "placedon"): ON,
    ("ontable", "onthetable"): "write z({a}) <= 0 m; what nothing is declared for stands on the table",
    ("supports", "carries"): "write restsOn({b}, {a}); what {b} stands on is declared: object {b} on {a}",
    ("into", "within", "isin", "inof", "isinside", "containedin", "containedby", "inside", "inregion"):
        "write insideOf({a}, {b}); of a region inside({a}, {b})",
    ("corner", "atcorner", "incorners"): "write inCorner({a})",
    ("edge", "atedge", "border", "atborder", "nearborder", "onedge"): "write nearEdge({a})",
    ("unstable", "balanced", "isstable", "stability"): "write stable([{a}]), or !stable([{a}])",
    ("facingeachother",): "write facing({a}, {b}) & facing({b}, {a})",
    ("size", "width", "length", "radius", "depth", "extent", "diameter", "area", "volume", "dimensions"): SIZES,
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
    ("open", "opened", "isopen", "closed", "isclosed", "shut", "ajar", "openness", "joint", "articulated"): OPEN,
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
     "cameras", "view", "viewpoint", "notvisible", "visibleregion"): SEEN,
    ("reachable", "isreachable", "inreach", "withinreach", "reachablefrom", "canreach", "reaches", "kinematic", "ik"):
        "write closeTo({a}, (0.5, -0.2), 0.7 m) with the place of the robot's base; of hands from above "
        "reachableFromAbove({a})",
    ("graspable", "isgraspable", "grasp", "cangrasp", "grasped", "pickable", "grippable"):
        "write the room that the gripper needs: forall q in others({a}): gap({a}, q) >= 3 cm; from above "
        "reachableFromAbove({a})",
    ("color", "colour", "colors", "hue", "rgb", "rgba", "texture", "material", "shade"): COLOR,
    ("mass", "weight", "friction", "density", "inertia", "velocity", "force", "physics"): BODY,
    ("upright", "standing", "lying", "tilted", "tilt", "roll", "pitch", "upsidedown", "flipped", "onside", "isupright",
     "fallen", "toppled"): LYING,
    ("light", "lighting", "lamp", "brightness", "background", "randomize", "augment", "augmentation", "domain"):
        f"pictures have looks, no spec has: see `scenegen explain pictures`; {MORE}",
    ("seed", "samples", "scenes", "timeout"): "an option of `scenegen sample` says how many scenes, and which seed",
    ("robot", "ego", "agent", "gripper", "arm", "mutate", "behavior", "scenario", "model"):
        f"a spec is about things on a table, without robots or scenarios; {MORE}",
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
    "on": ON,
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


def of_relation(name: str, arguments: Sequence[str]) -> str | None:
    """What to write instead of a call of a relation or function that there is not; None of unknown names."""
    word = plain(name)
    if word not in RELATIONS:
        word = known(re.findall(r"[A-Z]+(?![a-z])|[A-Z]?[a-z]+", name)) or ""  # to_the_left_of, isOn
        if word not in RELATIONS:
            return None
    a, b, *_ = (*arguments, "a", "b") if len(arguments) != 1 else (arguments[0], "b")
    of_number, to_number = (re.match(r"[\d.]", one) for one in (a, b))
    if word in OVER_A_HEIGHT and of_number:
        return None
    return (OVER_A_HEIGHT if word in OVER_A_HEIGHT and to_number else RELATIONS)[word].format(a=a, b=b)


def known(words: Sequence[str]) -> str | None:
    """The name in RELATIONS or INFIX that some words of a sentence are: `nextto` for `is next to`; None of others."""
    kept = list(words)
    while kept and kept[0].lower() in FILLERS:
        kept.pop(0)
    names = plain("".join(kept)), plain("".join(one for one in kept if one.lower() not in FILLERS))
    return next((name for name in names if name in RELATIONS or name in INFIX), None)


def between(first: str, words: Sequence[str], second: str, *, declared: bool) -> str | None:
    """What to write instead of `first words second`, in an object statement or in a formula; None of other words."""
    name = known(words) or plain("".join(words))
    if name == "is" and plain(second) in RELATIONS:  # `mug is clean`
        return RELATIONS[plain(second)].format(a=first, b="b")
    if declared and name in DECLARED:
        return f"write `{first} on {second}`"
    table = RELATIONS | INFIX
    if name not in table:
        return None
    if not declared and name in ("on", *DECLARED) and second.lower() in TABLES:
        return f"things stand on the table if nothing is declared: leave this out, or write restsOn({first}, workspace)"
    if not declared and name == "on" and second == "any":
        return f"a choice is declared, object {first} on any of [...]; each surface is asked for with restsOn"
    return ("in a formula " if declared and table[name].startswith("write") else "") + table[name].format(
        a=first, b=second
    )
