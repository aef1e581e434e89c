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


# --------------------------------------------------------------------------------------------------------------------
# Syntax errors of specs: bytes, brackets, words in the wrong place.


SPEC_TOO_LONG = Kind("spec-too-long", "{file} is too long: {characters:,} characters; the limit is {limit:,}")
BINARY_FILE = Kind("binary-file", "{file} is a binary file", help="a spec is a text file in UTF-8")
NOT_UTF8 = Kind(
    "not-utf8", "{file} is not UTF-8: byte 0x{byte:02x} in line {line}", help="save the file as UTF-8 in your editor"
)
ODD_LINE_BREAK = Kind(
    "odd-line-break",
    "character U+{point:04X} cannot stand in a spec",
    "some programs take it for a line break",
    "put a plain line break here",
)
HALF_CHARACTER = Kind(
    "half-character",
    "character U+{point:04X} cannot stand in a spec",
    "half of a character, which no file can hold",
    "leave it out",
)
EMPTY_SPEC = Kind(
    "empty-spec", "{file} is empty", "there is no formula here", "write one, for instance: leftOf(mug, plate)"
)
CANNOT_PARSE = Kind("cannot-parse", "cannot parse {file}: {reason}")
NESTED_TOO_DEEPLY = Kind(
    "nested-too-deeply",
    "this formula is nested too deeply",
    "more than {limit:,} levels down",
    "split it: give parts of it a name with `def`",
)
TOO_MANY_QUANTIFIERS = Kind(
    "too-many-quantifiers",
    "more than {limit} quantifiers stand inside each other",
    help="split it: give parts of it a name with `def`",
)
UNEXPECTED = Kind("unexpected", "unexpected {found}", "expected {expected}", (NEAREST, "{instead}"))
UNEXPECTED_END = Kind(
    "unexpected-end",
    ("the text ends after `{last}`", "the text ends"),
    "expected {expected}",
    "finish the formula",
)
UNCLOSED_BRACKET = Kind(
    "unclosed-bracket",
    "this `{opening}` is never closed",
    "`{closing}` is missing[[ ({open_brackets} brackets are open)]]",
    "add `{closing}` where it ends",
)
UNCLOSED_TEXT = Kind("unclosed-text", "this text is never closed", help='add `"` where it ends')
CLOSES_NOTHING = Kind("closes-nothing", "this `{closing}` closes nothing", help="remove it, or open it before")
WRONG_BRACKET = Kind(
    "wrong-bracket",
    "`{closing}` cannot close `{opening}`",
    "expected `{wanted}`",
    note="`{opening}` was opened in line {line}, column {column}",
)
NOTHING_INSIDE = Kind("nothing-inside", "expected {what} before `{closing}`", "nothing stands here")
NOTHING_ON_LEFT = Kind(
    "nothing-on-left", "`{word}` has nothing on its left", "expected a formula or a number before it", "{instead}"
)
NOTHING_ON_RIGHT = Kind("nothing-on-right", "this `{word}` has nothing on its right", help="remove it")
MISSING_OPERATOR = Kind(
    "missing-operator",
    "missing [[{comma} or ]]operator",
    "expected [[{comma} or ]]an operator before {before}",
    (
        "separate arguments with {comma}; join formulas with `&` (and), `|` (or) or `->` (implies)",
        "arguments stand in parentheses: {call}",
        "join the two parts with `&` (and), `|` (or) or `->` (implies),\nor give every formula a name: {labels}",
        "join the two parts with `&` (and), `|` (or) or `->` (implies)[[; only {only} can be called]]",
    ),
)
MISSING_COLON = Kind(
    "missing-colon", "missing `:`", "expected `:` before the formula", "write forall i in 1..6: formula"
)
MISSING_EQUAL = Kind(
    "missing-equal", "expected `=` here", help="constants and definitions are written with `=`, labels with `:`"
)
MISSING_DEF = Kind("missing-def", "a definition opens with `def`", help="write `def {head} = ...`")
MISSING_LABEL_COLON = Kind("missing-label-colon", "a formula is named with `:`", help="write `{name}: {formula}`")
DEFINITION_WITHOUT_PARAMETERS = Kind(
    "definition-without-parameters",
    "a definition needs its parameters",
    "expected `(`",
    "write {head}(a, b) = ..., or {head}() = ... if it has none; for a number write const",
)
UNNAMED_FORMULA = Kind(
    "unnamed-formula",
    "a formula without a name",
    "expected a statement",
    "a formula among statements needs a name: `task: {formula}`",
)
STATEMENT_AFTER_FORMULA = Kind(
    "statement-after-formula",
    "unexpected `{word}`",
    "an unnamed formula stands alone",
    "give the formula before it a name: `task: ...`",
)
UNFINISHED_STATEMENT = Kind(
    "unfinished-statement",
    "a statement opens here",
    "expected {expected} before it",
    "finish the statement before it",
)
LABEL_INSIDE_FORMULA = Kind(
    "label-inside-formula",
    "a name with `:` opens a statement",
    "it cannot stand inside a formula",
    "finish the formula before it",
)
KEYWORD_AS_NAME = Kind(
    "keyword-as-name",
    "`{word}` is a keyword",
    ("expected {expected}", "it cannot name a formula"),
    "choose another name",
)
KEYWORD_CASE = Kind("keyword-case", "unknown word `{word}`", help="keywords are lower case: `{keyword}`")
UNKNOWN_STATEMENT = Kind("unknown-statement", "unknown statement `{name}`", help=NEAREST)
UNKNOWN_UNIT = Kind(
    "unknown-unit",
    "unknown unit `{name}`",
    help="[[write {instead}; ]]units are m, cm, mm, rad, deg and turn[[; {times}]]",
)
UNIT_AFTER_NAME = Kind(
    "unit-after-name", "`{name}` cannot have a unit", help="a unit follows a written number: {name} * 1 {unit}"
)
BARE_POINT = Kind("bare-point", "a number starts and ends with a digit", help="write {mended}")
CANNOT_BE_SAID = Kind("cannot-be-said", "`{word}` cannot be said here", help="{instead}")
FOREIGN_OPERATOR = Kind("foreign-operator", "`{operator}` is not an operator here", help="write {instead}")
EQUALITY = Kind(
    "equality",
    "two numbers are never exactly equal in a random scene",
    help=("{instead}", "allow a tolerance: abs(a - b) <= 0.01; of two things say whether they differ: a != b"),
)
STRAY_EQUAL = Kind(
    "stray-equal",
    "`=` only stands in `const`, `def`, `object` and `region`",
    help=("{instead}", "to compare numbers write `<=` or `>=`, with a tolerance abs(a - b) <= 1 cm"),
)
SEMICOLON = Kind("semicolon", "statements cannot be separated with `;`", help="start the next statement on a new line")
COMMA_BETWEEN_FORMULAS = Kind(
    "comma-between-formulas",
    "`,` cannot join formulas",
    help="join formulas with `&` (and), `|` (or) or `->` (implies)",
)
QUOTED_NAME = Kind(
    "quoted-name",
    "names stand without quotes",
    help='write leftOf(mug, plate); file names stand in "double quotes"',
)
BRACES = Kind("braces", "braces mean nothing here", help="group with ( ), list with [ ]")
FOREIGN_COMMENT = Kind("foreign-comment", "`{operator}` opens no comment here", help="comments start with `#`")
LOOKALIKE = Kind("lookalike", "`{character}` is {what}", help="{instead}")
NO_IF = Kind("no-if", "there is no `{word}` here", help="write condition -> consequence")
INFIX_RELATION = Kind(
    "infix-relation",
    "a relation is written in front of its arguments",
    help=("{instead}", "write {name}({first}, {second})"),
)
NESTED_ARRAY = Kind(
    "nested-array", "an array has one number of elements", help="declare several arrays: object block[2], cup[3]"
)
COLON_AFTER_WORKSPACE = Kind(
    "colon-after-workspace", "`workspace` takes no `:`", help="write workspace [0, 1] x [0, 1]"
)
COLON_IN_ARGUMENT = Kind("colon-in-argument", "an argument is named with `=`", help="write {name} = ...")
OBJECTS_WITHOUT_NAMES = Kind(
    "objects-without-names", "`object` needs names", "a statement opens here", "write object mug, plate"
)
