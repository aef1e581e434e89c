"""Errors in the meaning of a spec: names, values, units, shapes, formulas that are the same in every scene."""

from __future__ import annotations

from scenegen.errors.diagnostic import NEAREST, Kind

# names
UNKNOWN_RELATION = Kind(
    "unknown-relation",
    "unknown relation `{name}`",
    "no relation or function has this name",
    ("{instead}", NEAREST, "the relations are {relations:quoted8}; `scenegen relations` lists all of them"),
)
UNKNOWN_NAME = Kind(
    "unknown-name",
    "unknown name `{name}`",
    ("{wanted} is needed here", "no object, constant or label has this name"),
    ("{instead}", NEAREST, "the objects are {objects:quoted8}", "declare it: object {name}"),
)
UNKNOWN_CONSTANT = Kind(
    "unknown-constant", "unknown constant `{name}`", help=("{instead}", NEAREST, "define it: const {name} = 1")
)
NOT_A_CONSTANT = Kind("not-a-constant", "`{name}` is not a constant", "only numbers and constants can stand here")
NOT_A_RELATION = Kind("not-a-relation", "`{name}` is not a relation", "it cannot be called")
NOT_FINITE = Kind(
    "not-finite",
    "there is no `{name}` here",
    "all numbers are finite",
    "write a number; to set no limit, leave the comparison out",
)
DEFINED_TWICE = Kind(
    "defined-twice",
    "{what} is defined twice",
    "defined again here",
    "remove one of them",
    "first defined at {first}",
)
BUILT_IN_NAME = Kind("built-in-name", "`{name}` is {what}", "it cannot {use}", "choose another name")
CIRCULAR_DEFINITION = Kind(
    "circular-definition", "`{name}` is defined by itself", "it is used here again", note="{way}"
)
DUPLICATE_VARIABLE = Kind("duplicate-variable", "`{name}` is named twice", help="two variables need two names")
SHADOWED_VARIABLE = Kind(
    "shadowed-variable",
    "`{name}` would hide another `{name}`",
    "a variable or parameter of that name is in use here",
    "choose another name",
)
HIDDEN_NAME = Kind(
    "hidden-name",
    "the {kind} `{name}` hides {what} of that name",
    "here `{name}` means the {kind}",
    "choose another name",
    severity="warning",
)
UNUSED_NAME = Kind(
    "unused-name", "the {kind} `{name}` is never used", "{reason}", "remove it, or use it", severity="warning"
)

# parameters and arguments
TOO_MANY_PARAMETERS = Kind(
    "too-many-parameters",
    "`{name}` has more than {limit} parameters",
    help="give it a list of things instead",
)
DUPLICATE_PARAMETER = Kind("duplicate-parameter", "two parameters have the name `{name}`", help="rename one of them")
DEFAULT_BEFORE_REQUIRED = Kind(
    "default-before-required",
    "`{name}` has no default, but stands after one that has",
    help="move it before those that have one, or give it a default as well",
)
MISSING_ARGUMENTS = Kind("missing-arguments", "`{name}` needs its arguments", help="write {usage}")
NO_ARGUMENTS = Kind("no-arguments", "`{name}` takes numbers, or a list of them", help="write {usage}")
ONE_ARGUMENT = Kind(
    "one-argument",
    "`{name}` takes two or more arguments",
    "1 given",
    "write {name}(a, b), or {name}(items) with a list of numbers",
)
WRONG_NUMBER_OF_ARGUMENTS = Kind(
    "wrong-number-of-arguments", "`{name}` takes {takes}, not {given}", "{label}", "write {usage}"
)
UNNAMED_AFTER_NAMED = Kind(
    "unnamed-after-named", "an argument without a name after one with a name", help="write {name} = ..."
)
UNKNOWN_PARAMETER = Kind("unknown-parameter", "`{function}` has no parameter `{name}`", help=(NEAREST, "write {usage}"))
DUPLICATE_ARGUMENT = Kind("duplicate-argument", "`{name}` is given twice", help="write {usage}")
SAME_ARGUMENT_TWICE = Kind(
    "same-argument-twice",
    "`{name}` of a thing and itself",
    "the same in every scene",
    "its two arguments must be different things",
)

# values and units
WRONG_TYPE = Kind(
    "wrong-type",
    "{role} must be {wanted}, not {found}",
    ("taken for {inferred}: nothing else has this name", "this is {found}"),
    "[[{remedy}]][[;\nif `-` is part of the name `{dashed}-...`, write `_` instead]]",
)
MIXED_LIST = Kind(
    "mixed-list",
    "a list has either lists or other values, not both",
    "this is a list",
    "join lists with `+`: {mended}",
)
UNIT_MISMATCH = Kind(
    "unit-mismatch",
    "{left} is {verb} {right}",
    help="lengths are in m, cm or mm; angles in rad, deg or turn[[; {times}]]",
)
UNIT_OF_ARGUMENT = Kind(
    "unit-of-argument",
    "`{name}` takes {wanted}, not {found}",
    help="lengths are in m, cm or mm; angles in rad, deg or turn",
)
MORE_THAN_A_TURN = Kind(
    "more-than-a-turn",
    "{amount:g} radians are more than a turn",
    "a bare number beside an angle is in radians",
    "write {amount:g} deg, or {amount:g} rad if you mean it",
)
NOT_AN_ANGLE = Kind("not-an-angle", "a heading is an angle, not {found}", help="write 90 deg")
NOT_A_LENGTH = Kind("not-a-length", "{what} is measured in metres, not as {found}")
NOT_A_PLAIN_NUMBER = Kind("not-a-plain-number", "{what} is a plain number, not {found}")
NOT_A_WHOLE_NUMBER = Kind("not-a-whole-number", "{what} is a whole number", "this is {value:g}")
NOT_CONSTANT = Kind("not-constant", "{what} must be a constant", "this depends on the scene")
CONSTANT_FROM_SCENE = Kind(
    "constant-from-scene",
    "a constant cannot depend on the scene",
    help="write a definition: def {name}() = {formula}",
)
WRONG_OVERRIDE = Kind("wrong-override", "`{name}` must be {wanted}[[, not {found}]]", help="the prelude's is {usual}")
NUMBER_TOO_LARGE = Kind("number-too-large", "this number is too large")
PHI_TOO_LARGE = Kind(
    "phi-too-large",
    "[[{file}: ]]phi of `{label}` can be larger than a computer's numbers",
    help="use smaller constants or fewer products",
)
DIVISION_BY_SCENE = Kind(
    "division-by-scene",
    "only a constant can divide",
    "this depends on the scene",
    "multiply both sides of the comparison by it instead",
)
DIVISION_BY_ZERO = Kind("division-by-zero", "division by zero")
NOT_TWO_COORDINATES = Kind(
    "not-two-coordinates",
    "a point has two coordinates, x and y",
    "{given} given",
    "a heading stands only behind `at`",
)
COORDINATE_WITH_DOT = Kind("coordinate-with-dot", "a coordinate is not written with a dot", help="write {axis}({base})")
TEXT_IN_FORMULA = Kind("text-in-formula", "a text cannot stand in a formula", help="write names without quotes")
SHAPE_IN_FORMULA = Kind(
    "shape-in-formula",
    "`{name}` is the shape of {kind}",
    "a formula cannot hold it",
    "give {kind} that shape: {opening} name = {shape}",
)
MISPLACED_VALUE = Kind("misplaced-value", "{what} cannot stand here", "the {parameter}", "write {usage}")

# lists, arrays, parts
ADDED_TO_A_LIST = Kind("added-to-a-list", "`+` joins a list to another list, not to {found}", help="write [{single}]")
EMPTY_LIST = Kind("empty-list", "this list is empty", "{needs}")
TOO_FEW_TO_CHOOSE = Kind(
    "too-few-to-choose",
    "there are no {needed} to choose from {found}",
    "`{kind}` has nothing to range over",
)
ONE_NEIGHBOUR = Kind(
    "one-neighbour",
    "neighbours come in twos or more",
    "one variable given",
    "write {kind} p, q in {domain}: ...",
)
EMPTY_RANGE = Kind("empty-range", "the range {lowest}..{highest} is empty", "it counts upwards", "write {instead}")
STRAY_RANGE = Kind(
    "stray-range", "a range cannot stand here", help="a range stands in a quantifier: forall i in 1..6: ..."
)
NOT_AN_ARRAY = Kind("not-an-array", "`{name}` is one object, not an array", help="declare an array: object {name}[7]")
INDEX_OUT_OF_RANGE = Kind(
    "index-out-of-range",
    "there is no element {index} of {count}",
    ("it has the elements 1 to {last}", "the list is empty"),
)
NO_SUCH_PART = Kind(
    "no-such-part",
    "{what} has no `.{name}`",
    "[[`{region}` is {what}]]",
    (NEAREST, "it has {parts:members}", "it has {known:members}", "only regions, the workspace and lists have parts"),
)
PART_OF_AN_OBJECT = Kind(
    "part-of-an-object",
    "`{name}` has no `.{part}`",
    ("`{inferred}` is taken for an object: nothing else has this name", "this is an object"),
    (
        "declare it: region {inferred} = rect(0.3, 0, 0.7, 0.2)",
        "did you mean `.{meant}`? things can stand on its {surfaces:members}",
        "things can stand on its {surfaces:members}[[; for where the object ends write {edge}Edge({name})]]",
        "only regions and the workspace have named points[[; for where the object ends write {edge}Edge({name})]]",
    ),
)
