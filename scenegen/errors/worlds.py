"""What is wrong with planning problems: PDDL and BDDL files, maps of predicates, goals without geometry; and with
suites."""

from __future__ import annotations

from scenegen.errors.diagnostic import NEAREST, Kind

# text
PDDL_TEXT = Kind(
    "pddl-text",
    (
        "{file} holds a character that no PDDL file has{character:?}",
        "the parentheses are more than {limit:,} deep",
        "the parentheses do not match",
    ),
    ("{character}", "one too many{limit:?}", "never closed: {opened:?}", "nothing is open here"),
)
PDDL_NO_PROBLEM = Kind(
    "pddl-no-problem", "{file} is not a PDDL problem: {reason}", help="it starts with `(define (problem NAME) ...)`"
)
PDDL_FORM = Kind("pddl-form", "this is not {wanted}", "{reason}")
PDDL_UNKNOWN_NAME = Kind("pddl-unknown-name", "unknown {what} `{name}`", "not declared", help=(NEAREST, "{advice}"))
PDDL_TOO_LARGE = Kind(
    "pddl-too-large",
    (
        "{file} declares {count:,} things",
        "{count:,} facts could hold in a scene",
        "{what} has too many instances",
    ),
    help=(
        "the limit is {limit:,}: leave out those that the goal does not need{file:?}",
        "the limit is {limit:,}; name the relations that you need, as in --facts leftOf,on{count:?}",
        "the limit is {limit:,}",
    ),
)

# meaning
UNKNOWN_CATEGORY = Kind(
    "unknown-category",
    "no size is known for things of the kind `{name}`",
    help='give it one in a map: [objects] {key} = "box(10 cm, 10 cm, 10 cm)"[[; nearest: {near:quoted}]]',
)
UNKNOWN_PREDICATE = Kind(
    "unknown-predicate",
    "no relation is known for the predicate `{name}`: it is left out",
    help='map it: [predicates] {key} = [["{relation}", or ]]"none"[[; nearest: {near:quoted}]]',
    severity="warning",
)
NO_SPATIAL_GOAL = Kind(
    "no-spatial-goal",
    "nothing in the goal of {file} is about places[[: {missing:quoted}]]",
    help=(
        'give `{thing}` a body in a map: [objects] {kind} = "cylinder(20 cm, 1 m)"',
        'map a predicate to a relation, as in [predicates] {key} = "closeTo($1, $2)"',
    ),
)
BAD_MAP = Kind("bad-map", "{file} is not a map of objects and predicates: {reason}")
MAP_NAMES_NOTHING = Kind(
    "map-names-nothing",
    "{file} maps {names:quoted5}, which the problem does not have",
    help=NEAREST,
    severity="note",
)
IMPORT_FAILS = Kind(
    "import-fails",
    "{file} makes no spec that holds: {reason}",
    help=("{advice}", "give its things other sizes in a map"),
)

# export
FACTS_MEAN_NOTHING = Kind(
    "facts-mean-nothing",
    "`{formula}`, which the map gives the predicate `{name}`, means nothing for these things[[: {reason}]]",
    help="write a relation of the language in which $1 and $2 are the arguments",
)
NO_GOAL_OVER_TIME = Kind(
    "no-goal-over-time",
    "the labels of a spec over time are goals of motions, not of scenes",
    help="export the motions: the goal is then what holds at their last moment",
)
PDDL_GOAL = Kind(
    "pddl-goal",
    (
        "a margin of the goal is exactly 0 in {edge:,} of the scenes: phi takes such a formula and its negation for "
        "true, planners do not",
        "what is no relation of things in the goal is a predicate by number: {parts}",
        "the formula of {labels:quoted} has more than {limit:,} parts: the goal has the label as one fact",
        "no scene decides {facts:quoted}: the goal asks for what {file} says of it",
        "{labels:quoted}: PDDL has no words for what is said of a whole motion; the goal is all that holds in the end",
    ),
    severity="note",
)
NOT_ITS_SCENES = Kind(
    "not-its-scenes",
    "the scenes are not of {file}: they have no `{name}`",
    help="give the problem, domain and map that the spec was imported from",
)
ONE_PROBLEM_A_FILE = Kind(
    "one-problem-a-file",
    "{path} is one file, and there are {count:,} scenes",
    help="a PDDL file holds one problem: name a folder",
)


PLACEMENT = Kind(
    "placement",
    (
        "the spec has no place for {strangers:quoted} of the environment",
        "{fixed:quoted} are among the fixtures already",
        "no fixture has the name of the reference, `{reference}`",
        "none of {tried} scenes keeps clear of the fixtures {fixtures:quoted}",
        "the environment has no object `{name}`",
        "{found} of {wanted} states hold in the simulation; of the others {reasons}",
    ),
    help=(
        "declare them in the spec, name them in `names`, or give `rest`, a sampler of robosuite's own{strangers:?}",
        "leave them out of `fixtures`{fixed:?}",
        "the fixtures are {known:quoted}{reference:?}",
        "give `fixtures`, or a place (x, y, z){reference:?}",
        "declare the fixtures in the spec, or give `ensure_valid_placement=False`{tried:?}",
        "its objects are {known:quoted}; give the object's name there in `names`, or hold it in place with `at`",
        "ask for another range of phi{found:?}",
    ),
)

# suites
NOT_A_SUITE = Kind(
    "not-a-suite",
    "{file} is not {what}: {reason}",
    help="`scenegen suite new` makes suites, `scenegen suite run` outcomes, `scenegen fit` fits; none is edited",
)
WORLD_FAILS = Kind(
    "world-fails",
    "{what} `{name}` {how}: {reason}",
    help="try it by itself; <resume> goes on with the outcomes that there are",
)
METAWORLD_START = Kind(
    "metaworld-start",
    (
        "Meta-World's {task} places {wanted:quoted}, and the spec has {objects:quoted}",
        "start {number} of {task} has `{name}` at ({x:.3f}, {y:.3f}), where Meta-World never draws it",
        "start {number} of {task} has another phi of `{label}` in Meta-World: {unturned:.4f}, not {phi:.4f}",
        "Meta-World's {task} never takes start {number}: `obj` and `target` are {apart:.1f} cm apart",
        "Meta-World's {task} says that `{name}` of start {number} is {off:.1f} mm off",
    ),
    help=(
        "name them so, and hold all others in their places with `at`{wanted:?}",
        "its range is {low} to {high}, in metres: require that of x(obj) and y(obj), or x(target) and y(target){low:?}",
        "it turns nothing: give them round footprints, or leave their headings out of the formula{label:?}",
        "require them farther apart: 15 cm in most of its environments, 25 cm in box-close-v3{apart:?}",
        "what it observes there is no object that it places: choose another environment",
    ),
)

# a suite on a real table
STAGE_PHOTO = Kind(
    "stage-photo",
    (
        "{file} is no picture: {reason}",
        "{file} is no calibrated camera{wanted:?}",
        "{file} is mirrored{mirrored:?}",
        "no new picture is in {folder}",
        "{file} shows no tag of the mat{count:?}",
        "{file} shows {seen} of the 4 tags of the mat: places are good to {spread:.0f} mm only",
        "no picture comes from the camera `{source}`",
    ),
    help=(
        "give it a photograph, .jpg or .png{reason:?}",
        "write {wanted}",
        "switch that off in the camera's settings{mirrored:?}",
        "take one, {folder} is looked at again at the next Enter",
        "all four corners of the mat should be in the picture, in focus and without glare; its tags are AprilTags"
        " 36h11, 0 to 3{count:?}",
        "take what covers them away, go farther away so that all four are in the picture, or give --camera{spread:?}",
        "give the number of a camera (0 is the first), a video, a folder's `%04d.png`, or a URL",
    ),
)
STAGE_MAT = Kind(
    "stage-mat",
    (
        "the mat in {file} is that of another suite: its tags are {found} of their sides apart, not {wanted}",
        "the mat in {file} is not flat: its tags are up to {off:.1f} mm off",
        "the mat in {file} was printed at {percent:.1f} %",
    ),
    help=(
        "`scenegen stage mat` prints the one of this suite{found:?}",
        "press it flat, and glue its tiles on something stiff; at most {most:.1f} mm are off in a good picture",
        "print it again at 100 %, not fitted to the page; its ruler is then 10 cm long",
    ),
)
STAGE_THINGS = Kind(
    "stage-things",
    (
        "{file} shows {stranger:quoted}, which this start does not have[[, and not {missing:quoted}]]",
        "{file} does not show {missing:quoted}",
        "`{name}` stands off the table: at {x:.1f} cm, {y:.1f} cm",
        "`{name}` is turned by {theta:g} in {file}: that is more than 2 pi{theta:?}",
        "the outline of `{name}` does not fit the corners in {file}: it is {off:.1f} mm off",
    ),
    help=(
        "take it away, or see whether tags are mixed up{stranger:?}",
        "turn its tag to the camera, and take the picture from nearer, where nothing covers it{missing:?}",
        "the mat ends at {table}; a table of poses is in metres",
        "headings are in radians, from the right-hand side of the mat{theta:?}",
        "give the corners of its top, three at least, two of a box",
    ),
)
