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
    ("{constant:?}unknown constant `{name}`", "unknown name `{name}`"),
    ("{constant:?}", "{wanted} is needed here", "no object, constant or label has this name"),
    (
        "{instead}",
        NEAREST,
        "{constant:?}define it: const {name} = 1",
        "the objects are {objects:quoted8}",
        "declare it: object {name}",
    ),
)
WRONG_NAME = Kind(
    "wrong-name",
    ("{relation:?}`{name}` is not a relation", "`{name}` is not a constant"),
    ("{relation:?}it cannot be called", "only numbers and constants can stand here"),
)
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
NAMED_TWICE = Kind(
    "named-twice",
    (
        "{parameter:?}two parameters have the name `{name}`",
        "{usage:?}`{name}` is given twice",
        "`{name}` is named twice",
    ),
    help=("{parameter:?}rename one of them", "write {usage}", "two variables need two names"),
)
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
WRONG_NUMBER_OF_ARGUMENTS = Kind(
    "wrong-number-of-arguments",
    (
        "`{name}` takes {takes}, not {given}",
        "{one:?}`{name}` takes two or more arguments",
        "{none:?}`{name}` takes numbers, or a list of them",
        "`{name}` needs its arguments",
    ),
    ("{label}", "{one:?}1 given"),
    ("{one:?}write {name}(a, b), or {name}(items) with a list of numbers", "write {usage}"),
)
WRONG_ORDER = Kind(
    "wrong-order",
    (
        "{argument:?}an argument without a name after one with a name",
        "`{name}` has no default, but stands after one that has",
    ),
    help=(
        "{argument:?}write {name} = ...",
        "move it before those that have one, or give it a default as well",
    ),
)
UNKNOWN_PARAMETER = Kind("unknown-parameter", "`{function}` has no parameter `{name}`", help=(NEAREST, "write {usage}"))
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
    (
        "`+` joins a list to another list, not to {found}",
        "a list has either lists or other values, not both",
    ),
    ("{found:?}", "this is a list"),
    ("write [{single}]", "join lists with `+`: {mended}"),
)
UNIT_MISMATCH = Kind(
    "unit-mismatch",
    "{left} is {verb} {right}",
    help=(
        "{share:?}write the share times a length: 25 % * 1 m",
        "lengths are in m, cm or mm; angles in rad, deg or turn[[; {times}]]",
    ),
)
WRONG_UNIT = Kind(
    "wrong-unit",
    (
        "`{name}` takes {wanted}, not {found}",
        "{what} is in {wanted}, not {found}",
        "{length:?}{what} is measured in metres, not as {found}",
        "{angle:?}{what} is an angle, not {found}",
        "{what} is a plain number, not {found}",
    ),
    help=(
        "{name:?}lengths are in m, cm or mm; angles in rad, deg or turn",
        "{wanted:?}times are in s, ms or min: 0.5 s",
        "{angle:?}write 90 deg",
    ),
)
MORE_THAN_A_TURN = Kind(
    "more-than-a-turn",
    "{amount:g} radians are more than a turn",
    "a bare number beside an angle is in radians",
    "write {amount:g} deg, or {amount:g} rad if you mean it",
)
NOT_A_WHOLE_NUMBER = Kind("not-a-whole-number", "{what} is a whole number", "this is {value:g}")
NOT_CONSTANT = Kind(
    "not-constant",
    ("{formula:?}a constant cannot depend on the scene", "{what} must be a constant"),
    ("{formula:?}", "this depends on the scene"),
    "write a definition: def {name}() = {formula}",
)
WRONG_OVERRIDE = Kind("wrong-override", "`{name}` must be {wanted}[[, not {found}]]", help="the prelude's is {usual}")
NUMBER_TOO_LARGE = Kind("number-too-large", "this number is too large")
PHI_TOO_LARGE = Kind(
    "phi-too-large",
    "[[{file}: ]]phi of `{label}` can be larger than a computer's numbers",
    help="use smaller constants or fewer products",
)
WRONG_DIVISOR = Kind(
    "wrong-divisor",
    ("{zero:?}division by zero", "only a constant can divide"),
    ("{zero:?}", "this depends on the scene"),
    ("{zero:?}", "multiply both sides of the comparison by it instead"),
)
NOT_TWO_COORDINATES = Kind(
    "not-two-coordinates",
    "a point has two coordinates, x and y",
    "{given} given",
    "a heading stands only behind `at`",
)
MISPLACED_VALUE = Kind(
    "misplaced-value",
    (
        "`{name}` is the shape of {kind}",
        "{text:?}a text cannot stand in a formula",
        "{what} cannot stand here",
        "a range cannot stand here",
    ),
    ("{shape:?}a formula cannot hold it", "the {parameter}"),
    (
        "give {kind} that shape: {opening} name = {shape}",
        "{text:?}write names without quotes",
        "write {usage}",
        "a range stands in a quantifier: forall i in 1..6: ...",
    ),
)

# lists, arrays, parts
TOO_FEW_ELEMENTS = Kind(
    "too-few-elements",
    (
        "there are no {needed} to choose from {found}",
        "{domain:?}neighbours come in twos or more",
        "this list is empty",
    ),
    ("{needed:?}`{kind}` has nothing to range over", "{domain:?}one variable given", "{needs}"),
    "write {kind} p, q in {domain}: ...",
)
EMPTY_RANGE = Kind("empty-range", "the range {lowest}..{highest} is empty", "it counts upwards", "write {instead}")
NOT_AN_ARRAY = Kind("not-an-array", "`{name}` is one object, not an array", help="declare an array: object {name}[7]")
INDEX_OUT_OF_RANGE = Kind(
    "index-out-of-range",
    "there is no element {index} of {count}",
    ("it has the elements 1 to {last}", "the list is empty"),
)
NO_SUCH_PART = Kind(
    "no-such-part",
    (
        "{axis:?}a coordinate is not written with a dot",
        "`{name}` has no `.{part}`",
        "{what} has no `.{name}`",
    ),
    (
        "{axis:?}",
        "`{inferred}` is taken for an object: nothing else has this name",
        "{part:?}this is an object",
        "[[`{region}` is {what}]]",
    ),
    (
        "write {axis}({base})",
        "declare it: region {inferred} = rect(0.3, 0, 0.7, 0.2)",
        "did you mean `.{meant}`? things can stand on its {surfaces:members}",
        "things can stand on its {surfaces:members}[[; for where the object ends write {edge}Edge({name})]]",
        "{part:?}only regions and the workspace have named points"
        "[[; for where the object ends write {edge}Edge({name})]]",
        NEAREST,
        "it has {parts:members}",
        "it has {known:members}",
        "only regions, the workspace and lists have parts",
    ),
)


SPEC_TOO_LONG = Kind(
    "spec-too-long",
    (
        "{file} is too long: {characters:,} characters; the limit is {limit:,}",
        "{path} is too large",
        "{files:?}more than {limit:,} files are imported",
        "this spec is too long with its imports; the limit is {limit:,} characters",
    ),
    "{path:?}the limit is {limit:,} bytes",
)
NOT_UTF8 = Kind(
    "not-utf8",
    ("{file} is not UTF-8: byte 0x{byte:02x} in line {line}", "{file} is a binary file"),
    help=("{byte:?}save the file as UTF-8 in your editor", "a spec is a text file in UTF-8"),
)
ODD_CHARACTER = Kind(
    "odd-character",
    "character U+{point:04X} cannot stand in a spec",
    ("{half:?}half of a character, which no file can hold", "some programs take it for a line break"),
    ("{half:?}leave it out", "put a plain line break here"),
)
NO_FORMULA = Kind(
    "no-formula",
    ("{empty:?}{file} is empty", "{file} has no formula"),
    ("{empty:?}there is no formula here", "nothing says what the scenes must satisfy"),
    ("{empty:?}write one, for instance: leftOf(mug, plate)", "add one: task: leftOf(mug, plate)"),
)
CANNOT_PARSE = Kind("cannot-parse", "cannot parse {file}: {reason}")
NESTED_TOO_DEEPLY = Kind(
    "nested-too-deeply",
    (
        "{quantifiers:?}more than {limit} quantifiers stand inside each other",
        "{operators:?}a spec has no more than {limit:,} operators of time",
        "this formula is nested too deeply",
    ),
    ("{quantifiers:?}", "{operators:?}this is one more", "more than {limit:,} levels down"),
    (
        "{operators:?}give parts of the formula a name with `def`, or range over them with `forall`",
        "split it: give parts of it a name with `def`",
    ),
)
UNEXPECTED = Kind(
    "unexpected",
    ("unexpected {found}", "the text ends after `{last}`", "the text ends"),
    "expected {expected}",
    (NEAREST, "{instead}", "{end:?}finish the formula"),
)
UNCLOSED = Kind(
    "unclosed",
    ("this `{opening}` is never closed", "this text is never closed"),
    "`{closing}` is missing[[ ({open_brackets} brackets are open)]]",
    ("add `{closing}` where it ends", 'add `"` where it ends'),
)
WRONG_BRACKET = Kind(
    "wrong-bracket",
    ("`{closing}` cannot close `{opening}`", "this `{closing}` closes nothing"),
    "expected `{wanted}`",
    ("{opening:?}", "remove it, or open it before"),
    "`{opening}` was opened in line {line}, column {column}",
)
NOTHING_BESIDE = Kind(
    "nothing-beside",
    (
        "expected {what} before `{closing}`",
        "{right:?}this `{word}` has nothing on its right",
        "`{word}` has nothing on its left",
    ),
    ("{closing:?}nothing stands here", "{right:?}", "expected a formula or a number before it"),
    ("{right:?}remove it", "{instead}"),
)
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
MISSING_SIGN = Kind(
    "missing-sign",
    (
        "{formula:?}a formula is named with `:`",
        "{parameters:?}a definition needs its parameters",
        "{head:?}a definition opens with `def`",
        "{equal:?}expected `=` here",
        "missing `:`",
    ),
    (
        "{parameters:?}expected `(`",
        "{formula:?}",
        "{head:?}",
        "{equal:?}",
        "expected `:` before the formula",
    ),
    (
        "write `{name}: {formula}`",
        "{parameters:?}write {head}(a, b) = ..., or {head}() = ... if it has none; for a number write const",
        "write `def {head} = ...`",
        "{equal:?}constants and definitions are written with `=`, labels with `:`",
        "write forall i in 1..6: formula",
    ),
)
UNNAMED_FORMULA = Kind(
    "unnamed-formula",
    ("unexpected `{word}`", "a formula without a name"),
    ("{word:?}an unnamed formula stands alone", "expected a statement"),
    (
        "{word:?}give the formula before it a name: `task: ...`",
        "a formula among statements needs a name: `task: {formula}`",
    ),
)
UNFINISHED_STATEMENT = Kind(
    "unfinished-statement",
    ("{named:?}a name with `:` opens a statement", "a statement opens here"),
    ("{named:?}it cannot stand inside a formula", "expected {expected} before it"),
    ("{named:?}finish the formula before it", "finish the statement before it"),
)
KEYWORD_AS_NAME = Kind(
    "keyword-as-name",
    ("{keyword:?}unknown word `{word}`", "`{word}` is a keyword"),
    ("{keyword:?}", "expected {expected}", "it cannot name a formula"),
    ("keywords are lower case: `{keyword}`", "choose another name"),
)
UNKNOWN_STATEMENT = Kind("unknown-statement", "unknown statement `{name}`", help=NEAREST)
UNKNOWN_UNIT = Kind(
    "unknown-unit",
    ("{unit:?}`{name}` cannot have a unit", "unknown unit `{name}`"),
    help=(
        "a unit follows a written number: {name} * 1 {unit}",
        "[[write {instead}; ]]units are m, cm, mm, rad, deg and turn[[; {times}]]",
    ),
)
BARE_POINT = Kind("bare-point", "a number starts and ends with a digit", help="write {mended}")
CANNOT_BE_SAID = Kind("cannot-be-said", "`{word}` cannot be said here", help="{instead}")
FOREIGN_SIGN = Kind(
    "foreign-sign",
    (
        "`{character}` is {what}",
        "{semicolon:?}statements cannot be separated with `;`",
        "{comma:?}`,` cannot join formulas",
        "{quotes:?}names stand without quotes",
        "{braces:?}braces mean nothing here",
        "{comment:?}`{operator}` opens no comment here",
        "there is no `{word}` here",
        "{workspace:?}`workspace` takes no `:`",
        "{name:?}an argument is named with `=`",
        "`{operator}` is not an operator here",
    ),
    help=(
        "{character:?}{instead}",
        "{semicolon:?}start the next statement on a new line",
        "{comma:?}join formulas with `&` (and), `|` (or) or `->` (implies)",
        '{quotes:?}write leftOf(mug, plate); file names stand in "double quotes"',
        "{braces:?}group with ( ), list with [ ]",
        "{comment:?}comments start with `#`",
        "{word:?}write condition -> consequence",
        "{workspace:?}write workspace [0, 1] x [0, 1]",
        "write {name} = ...",
        "write {instead}",
    ),
)
EQUALITY = Kind(
    "equality",
    (
        "{single:?}`=` only stands in `const`, `def`, `object` and `region`",
        "two numbers are never exactly equal in a random scene",
    ),
    help=(
        "{instead}",
        "{single:?}to compare numbers write `<=` or `>=`, with a tolerance abs(a - b) <= 1 cm",
        "allow a tolerance: abs(a - b) <= 0.01; of two things say whether they differ: a != b",
    ),
)
INFIX_RELATION = Kind(
    "infix-relation",
    "a relation is written in front of its arguments",
    help=("{instead}", "write {name}({first}, {second})"),
)
NESTED_ARRAY = Kind(
    "nested-array", "an array has one number of elements", help="declare several arrays: object block[2], cup[3]"
)
OBJECTS_WITHOUT_NAMES = Kind(
    "objects-without-names", "`object` needs names", "a statement opens here", "write object mug, plate"
)

# time
TIME_MISSING = Kind(
    "time-missing",
    ("`{word}` is about time, and this spec has none", "`moves` is about steps, and this spec has none"),
    "{word:?}every scene stands by itself",
    (
        "{word:?}say how long a motion lasts: time 20 steps, or time [0, 10 s] every 0.5 s",
        "say how long a motion lasts: time 20 steps",
    ),
)
TIME_IN_IMPORT = Kind(
    "time-in-import",
    "only an imported file says how long a motion lasts",
    "{path} has a `time` statement",
    "move `time ...` from there into this spec",
)
HORIZON_OUT_OF_RANGE = Kind(
    "horizon-out-of-range",
    (
        "a motion cannot have {steps:,.15g} steps",
        "time begins at 0, not at {start:g} s",
        "a step cannot last {length:g} s",
    ),
    ("it has 1 to {limit:,}", "{start:?}", "each moment is later than the one before"),
    ("write every {such:g} s", "{start:?}write time [0, {length:g} s] every ..."),
)
NOT_WHOLE_STEPS = Kind(
    "not-whole-steps",
    "{amount:g}{unit} is not a whole number of steps",
    "[[a step is {dt:g} s]]",
    "write {mended}",
)
WRONG_WINDOW = Kind(
    "wrong-window",
    (
        "{swapped:?}this window is empty",
        "{lowest:?}this window begins after the last moment",
        "{none:?}`{operator}` takes no window",
        "this window begins before now",
    ),
    (
        "{swapped:?}it ends before it begins",
        "it begins {lowest:,} steps from now, and a motion has {steps:,}",
        "{none:?}",
        "`{operator}` looks at this moment and later ones",
    ),
    (
        "write {swapped}",
        "{lowest:?}let it begin earlier, or let time last longer",
        "{none:?}write {operator} f, or eventually[2, 5] f",
        "let it begin at 0",
    ),
)
WINDOW_CUT = Kind(
    "window-cut",
    "this window ends after the last moment",
    "it ends {highest:,} steps from now, and a motion has {steps:,}: what lies beyond is not looked at",
    "leave out the window, or let time last longer",
    severity="warning",
)
LOOKS_BEYOND = Kind(
    "looks-beyond",
    "{name} looks beyond the last moment: phi is {sign}infinity in every motion",
    "of no moment the least is infinity, and the largest minus infinity",
    "let what is around end earlier, such as always[0, {most}] for what `next` looks at",
)
NO_PLACE_OVER_TIME = Kind(
    "no-place-over-time",
    (
        "{most:?}random numbers of things have no place in a spec over time",
        "`on any of` has no place in a spec over time",
    ),
    ("{most:?}", "what an object stands on stays the same in a motion"),
    ("write {name}[{most}]", "name one surface"),
)
TIME_UNFINISHED = Kind(
    "time-unfinished",
    (
        "{movers:?}unknown word `{name}`",
        "unknown word `{name}` after a number of steps",
        "this `time` statement is not finished",
    ),
    (
        "{movers:?}expected `one` or `all`",
        "{name:?}expected `steps`",
        "expected `steps` after a number, or `every` and a time after an interval",
    ),
    (
        NEAREST,
        "{movers:?}write moves one: in each step one object moves; or moves all",
        "write time 20 steps, or time [0, 10 s] every 0.5 s",
    ),
)
