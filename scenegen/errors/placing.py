"""What is wrong with scenes that are put into the environments of other libraries."""

from __future__ import annotations

from scenegen.errors.diagnostic import Kind

OBJECT_NOT_PLACED = Kind(
    "object-not-placed",
    "the spec has no place for {objects:quoted} of the environment",
    help="declare them in the spec, name them in `names`, or give `rest`, a sampler of robosuite's own",
)
OBJECT_NOT_THERE = Kind(
    "object-not-there",
    "the environment has no object `{name}`",
    help="its objects are {known:quoted}; give the object's name there in `names`, or hold it in place with `at`",
)
ALREADY_PLACED = Kind(
    "already-placed", "{objects:quoted} are among the fixtures already", help="leave them out of `fixtures`"
)
UNKNOWN_REFERENCE = Kind(
    "unknown-reference",
    "no fixture has the name of the reference, `{name}`",
    help=("the fixtures are {known:quoted}", "give `fixtures`, or a place (x, y, z)"),
)
PLACEMENT_BLOCKED = Kind(
    "placement-blocked",
    "none of {tried} scenes keeps clear of the fixtures {fixtures:quoted}",
    help="declare the fixtures in the spec, or give `ensure_valid_placement=False`",
)
NO_START_YET = Kind("no-start-yet", "no scene was placed yet", help="reset the environment first")
NAME_TWICE = Kind("name-twice", "two objects have the name `{name}`", help="give each a name of its own in `names`")
TOO_FEW_LAYOUTS = Kind(
    "too-few-layouts",
    "{scenes} scenes for {environments} environments",
    help="each environment needs at least one: draw more scenes",
)
OBJECT_WITHOUT_JOINT = Kind(
    "object-without-joint",
    "`{name}` has no free joint, so no state says where it is",
    help="hold it in place in the spec, with `at`",
)
