"""Syntax errors of specs: bytes, brackets, words in the wrong place."""

from __future__ import annotations

from scenegen.errors.diagnostic import NEAREST, Kind

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
