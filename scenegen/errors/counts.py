"""Problems with random numbers of things: `object block[3..8]`."""

from __future__ import annotations

from scenegen.errors.diagnostic import NEAREST, Kind

# in specs
TOO_MANY_COUNTS = Kind(
    "too-many-counts",
    (
        "{combinations:,} combinations with the assets of `{asset}`, more than {limit}",
        "{combinations:,} combinations of numbers, more than {limit}",
    ),
    "each is a spec of its own",
    ('{asset:?}take fewer assets, drawn by a seed: category("...", most = 4, seed = 1)', "narrow the range"),
)
MAY_BE_MISSING = Kind(
    "may-be-missing",
    "`{name}[{index}]` may be missing",
    "there are {least} to {most} of `{name}`",
    "write forall or exists over `{name}`, {name}.last, or raise the least number: {name}[{index}..{most}]",
)
ONE_NUMBER = Kind(
    "one-number",
    "there are always {least} of `{name}`",
    "this range has one number",
    "write {name}[{least}]",
    severity="warning",
)
UNKNOWN_ASSET_CATEGORY = Kind(
    "unknown-asset-category",
    "no asset of {path} has the category `{name}`",
    help=(NEAREST, "it has {known:list}", 'write category = "{name}" below the assets that have it'),
)
NOT_A_CATEGORY = Kind("not-a-category", "this does not say of which category an object is", help="write {usage}")
NOT_OF_CATEGORY = Kind(
    "not-of-category",
    "`{name}` cannot be of a category: {what}",
    help='write {name} = asset("025_mug")',
)
COUNT_OF_LEVELS = Kind(
    "count-of-levels",
    "the number of levels of a region cannot be drawn",
    help=("write {name}[{levels}]", "give each level its height: region {name}[2] = ... at 30 cm, 60 cm"),
)
DEPENDS_ON_NUMBER = Kind(
    "depends-on-number",
    ("{asset:?}{what} depends on which assets are drawn", "{what} depends on how many things there are"),
    "it is not the same with {counted} and with {most}",
    (
        "{asset:?}nothing stands on an object of a category: its heights differ",
        "write numbers here that do not depend on the number of things",
    ),
    note="scene files say it once, for all scenes",
)
NUMBERS_OVER_TIME = Kind(
    "numbers-over-time",
    "random numbers of things have no place in a spec over time",
    help="write {name}[{most}]",
)

# in requests
NUMBERS_NOT_HERE = Kind(
    "numbers-not-here",
    (
        "{asset:?}{file} draws which asset `{name}` is: this takes specs in which the objects are fixed",
        "{file} draws how many things there are: this takes specs in which the numbers are fixed",
    ),
    help=(
        "fix it: `--count {name}={asset}`, or `with_counts` in Python",
        "fix them: `--count {name}={most}`, `with_counts` in Python, or {name}[{most}] in the spec",
    ),
)
UNKNOWN_COUNT = Kind(
    "unknown-count",
    "the spec draws no number of `{name}`",
    help=(
        "it draws each of them by itself: {each:list}",
        NEAREST,
        "it draws the numbers of {known:list}",
        "it draws no number of things",
    ),
)
UNKNOWN_PICK = Kind(
    "unknown-pick", "`{object}` cannot be the asset `{name}`", help=(NEAREST, "the spec draws one of {known:list}")
)
COUNT_OUT_OF_RANGE = Kind(
    "count-out-of-range",
    "there cannot be {number} of `{name}`",
    help="the spec draws {least} to {most}",
)
COUNT_SYNTAX = Kind(
    "count-syntax",
    "a number of things is written NAME=NUMBER",
    help="for instance: `<count=block=5>`; of an object of a category the asset: `<count=mug=025_mug>`",
)
COUNT_TWICE = Kind("count-twice", "the number of `{name}` is given twice")
HELD_MAY_BE_MISSING = Kind(
    "held-may-be-missing",
    "`{name}` cannot be held: it may be missing",
    help="hold what is always there, or fix the numbers with `<count>`",
)
NUMBER_LEFT_OUT = Kind(
    "number-left-out",
    "scenes with {counted} are left out: {why}",
    help="the other numbers share its scenes",
    note="",
    severity="warning",
)
NO_NUMBER_POSSIBLE = Kind(
    "no-number-possible",
    "no scenes came with any number of things: with {counted}, {why}",
    help="ask for another range, or for other numbers",
    note="",
)

# in files
NUMBERS_DISAGREE = Kind(
    "numbers-disagree",
    "{scene} of {file} does not say the same of how many things there are as its poses do",
    help="the first elements of an array are there, as many as its count says, and no others",
)
ONE_FILE_MANY_NUMBERS = Kind(
    "one-file-many-numbers",
    "{path} cannot hold scenes that differ in how many things there are",
    "a file of {format} with all scenes has the same bodies in each",
    "name a folder as <out>, which gets a file for each scene",
)
NUMBERS_IN_FILE = Kind(
    "numbers-in-file",
    (
        "{asset:?}these scenes differ in which asset `{name}` is: {what} takes scenes of the same objects",
        "these scenes differ in how many things there are: {what} takes scenes of the same objects",
    ),
    help=(
        "sample them with one asset: `--count {name}={asset}`",
        "sample them with fixed numbers: `--count {name}={most}`",
    ),
)
