"""Errors of a request: its arguments, ranges of phi, fixed objects, and unreachable targets."""

from __future__ import annotations

from scenegen.errors.diagnostic import NEAREST, Kind

# arguments
WRONG_VALUE = Kind(
    "wrong-value",
    "{argument:argument} is {value}",
    help="give it {wanted}",
)
OUT_OF_RANGE = Kind(
    "out-of-range",
    "{argument:argument} is {value}",
    help="it must be {wanted}[[; {hint}]]",
)
UNKNOWN_CHOICE = Kind(
    "unknown-choice",
    "[[{path}: ]]unknown {what} `{name}`",
    help=("{instead}", NEAREST, "the {plural} are {known:quoted}", "the {what}s are {known:quoted}"),
)
CONFLICTING_ARGUMENTS = Kind(
    "conflicting-arguments",
    "{one:argument} and {other:argument} contradict each other[[: {reason}]]",
    help="give one of them",
)
OUT_OF_PLACE = Kind(
    "out-of-place",
    ("{argument:argument} {rule}", "{option} {rule}"),
    help="{remedy}",
)
WITHOUT_MODEL = Kind(
    "without-model",
    "{argument:argument} {rule}, and no model takes part here",
    help="name a model file, or leave {argument:argument} out",
)
ARGUMENT_SYNTAX = Kind(
    "argument-syntax",
    "{what} is written {form}",
    help=("write a band: {band}", "for instance {example}"),
)
GIVEN_TWICE = Kind(
    "given-twice",
    "{what} is given twice",
    help="give it once",
)
NEEDED_HERE = Kind(
    "needed-here",
    "{what} is needed here, not {value}",
    help="{remedy}",
)
TOO_MANY = Kind(
    "too-many",
    (
        "{n:,} scenes of {objects} objects are too many for memory",
        "a .json file cannot hold {n:,} scenes: readers need all of it in memory",
    ),
    help=(
        "{objects:?}write them to a file with `<out=scenes.parquet>` (in Python: sample_to), or ask for at most "
        "{most:,}",
        "write .jsonl or .parquet, or ask for at most {most:,}",
    ),
)
UNKNOWN_SETTING = Kind(
    "unknown-setting", "[[{path}: ]]{owner} has no setting `{name}`", help=(NEAREST, "its settings are {known:quoted}")
)
WRONG_SETTING = Kind(
    "wrong-setting",
    ("[[{path}: ]]setting `{name}` of {owner}: {reason}", "{owner}: {reason}"),
    help=("by default `{name}` is {usual}", "its settings are {known:quoted}"),
)
MISSING_ARGUMENT = Kind("missing-argument", "{argument:argument} is missing: {question}")
NOT_AN_INDEX = Kind(
    "not-an-index",
    "{value} does not pick scenes",
    help=(
        "{hole:?}say yes or no of each scene: mask.fillna(False) in pandas, fill_null(False) in polars",
        "pick with a number, a slice, an array of numbers, or a mask of {count:,} truth values",
    ),
)
NO_SUCH_NUMBER = Kind(
    "no-such-number",
    "there is no {what} {number}",
    help=("{last:?}{file} holds the {what}s {first} to {last}", "{file} holds a single one, without a number"),
)
NO_SCENES = Kind("no-scenes", "there are no scenes[[ in {file}]][[ with {counted}]]", help="sample some first")
NOT_INSTALLED = Kind("not-installed", "{package} is needed {purpose}, and is not installed", help="{command}")
BAD_PLUGIN = Kind(
    "bad-plugin",
    "the {what} `{name}` of the package {package} cannot be used: {reason}",
    help="tell its authors; without it: `pip uninstall {package}`",
)
NO_ENCODER = Kind(
    "no-encoder",
    "PyAV on this machine cannot write H.264: its FFmpeg lacks {encoder}",
    help="install the wheel of PyAV from PyPI (`pip install --force-reinstall av`), or draw a GIF",
)
STEPS_FIXED = Kind(
    "steps-fixed",
    "a scene of the {model} is one evaluation of its network: there are no steps to choose",
    help="leave <steps> out, or take a flow",
)

# labels and ranges of phi
UNKNOWN_LABEL = Kind(
    "unknown-label",
    ("the spec has no label `{name}`", "no label stands before `=`"),
    help=(NEAREST, "the spec has {known:quoted8}"),
)
LABEL_NOT_NAMED = Kind(
    "label-not-named",
    "this spec has {count} labels, {labels:quoted8}[[; of which is phi {phi}?]]",
    "of which label?",
    ("say which label: `<phi={first}={text}>`", "name it: `<phi={first}=lowest:highest>`"),
)
NOT_A_NUMBER = Kind("not-a-number", "`{text}` is not a number", help="{usage}")
RANGE_NOT_A_PAIR = Kind(
    "range-not-a-pair",
    ("{end} cannot end a range of phi of `{label}`", "the range of phi of `{label}` is {value}"),
    help="write (lowest, highest), with None for an open end",
)
RANGE_REVERSED = Kind("range-reversed", "this range[[ of phi of `{label}`]] is reversed", help="write {high:g}:{low:g}")
BEYOND_BOUNDS = Kind(
    "beyond-bounds",
    "no scene can have phi of `{label}` in {range}",
    help="phi of `{label}` lies between {lowest:.4g} and {highest:.4g} in this workspace",
)
ONLY_AT_BOUND = Kind(
    "only-at-bound",
    "phi of `{label}` reaches {bound:g} with probability 0[[ with {counted}]][[; sampling {band} instead]]",
    help=(
        "ask for a band beside it, {ask}; phi of `{label}` lies between {lowest:.4g} and {highest:.4g}",
        "phi of `{label}` lies between {lowest:.4g} and {highest:.4g} in this workspace",
    ),
    severity="warning",
)
SINGLE_VALUE = Kind(
    "single-value",
    "phi of `{label}` is exactly {value:g} with probability 0",
    help="ask for a band: `<phi={label}={band}>`",
)

# fixed objects
UNKNOWN_OBJECT = Kind(
    "unknown-object", "the spec has no object `{name}`", help=(NEAREST, "the spec has {known:quoted8}")
)
CANNOT_BE_HELD = Kind(
    "cannot-be-held",
    (
        "`{name}` cannot be held at ({x:g}, {y:g}): that is outside the workspace",
        "`{name}` cannot be held: it {missing}",
        "`{name}` cannot be held while `{free}` is free: where it usually is goes with that",
        "`{name}` is held in place by the spec already",
    ),
    help=(
        "the workspace is {workspace}",
        "{missing:?}hold what is always there, or fix the numbers with `<count>`",
        "hold `{free}`, too, or take the `usually` of `{name}` away",
        "leave it out, or take the `at` of `{name}` away",
    ),
)
NOT_A_POSE = Kind(
    "not-a-pose", "the pose of `{name}` is {value}", help="write (x, y) or (x, y, theta), in metres and radians"
)
NOT_COMPLETED = Kind(
    "not-completed",
    "given scene {scene} cannot be completed: {reason}",
    help="leave it out, ask for a wider range, or give fewer objects; <keep_partial> keeps the others",
)
ALL_HELD = Kind("all-held", "every object is held in place: {consequence}", help="free an object")

# unreachable targets, and time limits
NO_SUCH_SCENE = Kind(
    "no-such-scene",
    (
        "no scene can have {wanted}",
        "no scene with {held:quoted8} there meets what the spec requires",
        "no scene meets what the spec requires",
    ),
    "{clash}",
    (
        "{held:?}hold other objects, or hold them elsewhere",
        "{required:?}`scenegen check` names the requirements that clash; require less",
        "{clash:?}ask for another range; `scenegen check` shows what each part can reach",
        "ask for another range",
    ),
    "{others}",
)
TOO_IMPROBABLE = Kind(
    "too-improbable",
    (
        "{thing:?}`{thing}` would be so far from its usual place that less than {share:g} of its distribution is left",
        "scenes with {wanted} are too improbable to find",
        "scenes that the spec allows are too improbable to find",
    ),
    help=("{thing:?}widen the distribution of `{thing}`", "ask for a wider range, or for larger tolerances"),
    note=("{thing:?}", "the range is not proved empty: single scenes may have such phi"),
)
REQUIREMENT_NOT_FOUND = Kind(
    "requirement-not-found",
    (
        "{file:?}no scene was found that meets what {file} requires, so there is nothing to say about any",
        "no {motion} was found that meets what the spec requires[[, in {evaluations:,} evaluations]]",
        "no scene was found that meets what the spec requires[[, in {evaluations:,} evaluations]]",
    ),
    help=(
        "{file:?}`scenegen check` names the requirements that clash",
        "{motion:?}require less, let objects move farther in a step, or make the workspace larger",
        "require less, or make the workspace larger",
    ),
    note="[[the best one misses it by {misses:.4g}]]",
)
NO_ROOM = Kind(
    "no-room",
    "no room was found for {names:quoted8}: {placed} of {count} objects could be placed, in {tried}",
    "[[`{clause}` refused {share:.0%} of the poses]]",
    ("{crowded:?}use fewer or smaller objects, or a larger area", "widen the range, or what the spec requires"),
    "the footprints of the {standing} objects take {filled:.0%} of {where}"
    "[[; of {tries:,} poses of `{first}`, {crowded:,} met all else and none was clear of what stands there]]"
    "[[; also refused: {others}]]",
)
TABLE_TOO_FULL = Kind(
    "table-too-full",
    (
        "no scene meets what is asked for: too much stands on {surfaces}",
        "no scene meets what is asked for: the table is too full",
    ),
    help=(
        "{surfaces:?}use fewer or smaller objects, a larger surface or one more, or smaller distances",
        "use fewer or smaller objects, a larger area, or smaller distances",
    ),
    note="{proof}",
)
NO_TIME_TO_GROW = Kind(
    "no-time-to-grow",
    (
        "time was up after {tried}: {placed} of {count} objects could be placed[[, with {counted}]]",
        "time was up after {tried}: all {count} objects could be placed, but no scenes were ready[[, with {counted}]]",
    ),
    help=(
        "{tight:?}use fewer or smaller objects, or a larger area; or give it more time with <timeout>",
        "give it more time with <timeout>, or ask for fewer scenes",
    ),
    note="the footprints of the {standing} objects take {filled:.0%} of {where}",
)
NO_TIME_TO_CHECK = Kind(
    "no-time-to-check",
    "time was up before it was known what the spec's phi can be[[ with {counted}]]",
    help="give it more time with <timeout>",
)
NO_TIME_TO_TELL = Kind(
    "no-time-to-tell",
    "time was up after {tried}, too early to tell which parts of the range can be reached"
    "[[ with {counted}]][[; {kept}]]",
    help=(
        "{partial:?}{cells:?}give it more time with <timeout>, ask for `<spread=base>`, "
        "or save what there is with <keep_partial>",
        "{cells:?}give it more time with <timeout>, or ask for `<spread=base>`",
        "{partial:?}give it more time with <timeout>, or save what there is with <keep_partial>",
        "give it more time with <timeout>, or ask for fewer scenes",
    ),
    note="[[nothing was found yet in {undecided} of {cells} cells]][[; {refused}]][[; {folder} keeps what is done: "
    "go on with <resume>]]",
)
_FOUND = (
    "found {found:,} of {n:,} scenes in {tried}[[; {kept}]]",
    "found none of {n:,} scenes in {tried}[[; {kept}]]",
)
_MORE = "[[; {refused}]][[; {folder} keeps what is done: go on with <resume>]]"
_LONGER = "give it more time with <timeout>"
_KEEP = ", or save what there is with <keep_partial>"
TOO_FEW_IN_RANGE = Kind(
    "too-few-in-range",
    _FOUND,
    "`{atom}` decides phi in {deciding:.0%} of those that fail",
    (f"{{found:?}}widen the range, {_LONGER}{_KEEP}", f"widen the range, {_LONGER}"),
    "phi of `{label}` was outside `{range}` in {share} of the last {candidates:,} candidates" + _MORE,
)
TOO_FEW_IN_CELL = Kind(
    "too-few-in-cell",
    _FOUND,
    help=(
        f"{{found:?}}{{cells:?}}ask for `<spread=base>`, leave out the rarest part of the range, or {_LONGER}{_KEEP}",
        f"{{cells:?}}ask for `<spread=base>`, leave out the rarest part of the range, or {_LONGER}",
        f"{{found:?}}{_LONGER}, ask for fewer scenes{_KEEP}",
        f"{_LONGER}, or ask for fewer scenes",
    ),
    note="[[{rarest} is the rarest part of the range]]" + _MORE,
)
TOO_FEW_MEET_REQUIREMENT = Kind(
    "too-few-meet-requirement",
    _FOUND,
    "`{atom}` decides phi in {deciding:.0%} of those that fail",
    (
        f"{{found:?}}require less, or make the workspace larger; or {_LONGER}{_KEEP}",
        f"require less, or make the workspace larger; or {_LONGER}",
    ),
    "phi of `{label}` was outside `{range}` in {share} of the last {candidates:,} candidates" + _MORE,
)
PROPOSALS_NOT_NUMBERS = Kind(
    "proposals-not-numbers",
    _FOUND,
    help="the model is of no use; train it again",
    note="in each of the last {candidates:,} candidates a coordinate was not a number" + _MORE,
)
OUT_OF_TIME = (NO_TIME_TO_CHECK, NO_TIME_TO_TELL, TOO_FEW_IN_RANGE, TOO_FEW_IN_CELL, TOO_FEW_MEET_REQUIREMENT)
CUT_SHORT = Kind(
    "cut-short",
    "time was up: phi may reach further than it did, and bars are wider than they need be[[; nothing is known of "
    "{left_out}]]",
    help="give it more time with <timeout>",
    severity="warning",
)
UNREACHED_CELLS = Kind(
    "unreached-cells",
    "{missing} of {count} cells of the range were not reached in {tried}",
    help="the scenes are spread over the others",
    note="{shown}[[ and {more} more]][[; interval bounds rule out {ruled_out} of them]]"
    "[[; a scene was met in {strays} of them, too late to share in]]",
    severity="warning",
)
SCENES_ALIKE = Kind(
    "scenes-alike",
    (
        "scenes of one ancestor are still alike: each is worth {share:.0%} of an independent one[[, with {counted}]]",
        "after {moves:,} moves the chains still resemble what they were ({correlation:.0%} correlation)"
        "[[, with {counted}]]",
    ),
    help="compare runs with several seeds",
    note=(
        "{share:?}the table may be too full for its objects to pass each other; shares of arrangements are uncertain",
        "the range may have parts between which no move leads; the shares of such parts are uncertain",
    ),
    severity="warning",
)
UNSETTLED = Kind(
    "unsettled",
    "{summary}[[, with {counted}]]",
    help="{often:?}objects that overlap push each other away: `require noOverlap()`, or where things stand on each "
    "other `require noCollision() & stable()`, leaves such scenes out from the start",
    severity="warning",
)
CHOICES_NOT_HERE = Kind(
    "choices-not-here",
    (
        "{what} cannot take this spec: {why}",
        "{what} cannot take specs in which an object stands on one of several surfaces",
    ),
    "`{name}` is declared with `on any of`, and poses alone do not say on what it stands",
    "let `{name}` stand on one surface",
)

# motions, and pairs of a start and a goal
TIME_NOT_HERE = Kind(
    "time-not-here",
    "{file} is a spec over time: this takes specs of single scenes",
    help="score motions with `scenegen eval` or spec.trace_robustness(), or leave out `time` and the words of time",
)
NOT_OVER_TIME = Kind(
    "not-over-time",
    "{file} is a spec of single scenes: its motions have no phi",
    help="say how long a motion lasts: time 20 steps; for scenes call spec.robustness()",
)
MOTION_HAS_ENDED = Kind(
    "motion-has-ended",
    "the motion has ended: its {moments:,} moments were added, the last at {end:g} s",
    help="call reset() before another motion begins",
)
TOO_FEW_MOTIONS = Kind(
    "too-few-motions",
    (
        "found {found:,} of {wanted:,} {pairs}[[ with {counted}]]: {reason}",
        "found {found:,} of {wanted:,} motions: {reason}[[; {folder} keeps what is done: go on with <resume>]]",
    ),
    help=(
        "{pairs:?}ask for a wider range of starts, for another number of moved objects, or for more time",
        "ask for another range or for more time, or let objects move faster or in more steps",
    ),
)
CANNOT_MOVE_SO_MANY = Kind(
    "cannot-move-so-many",
    "{wanted} objects cannot move: {free} of them can",
    help="ask for {most} at most",
)
NO_ROBOT = Kind(
    "no-robot",
    ("{known:?}`{name}` is no robot of the spec", "the spec has no robot"),
    help=(NEAREST, "its robots: {known:quoted}", "write `robot arm = panda at (0.5, -0.25, NORTH)`"),
)
NOTHING_TO_GRASP = Kind(
    "nothing-to-grasp",
    "there is nothing to grasp: the spec holds all things where they are",
    help="leave out the `at` of what is to be moved",
)
NO_BOUND_ON_STEPS = Kind(
    "no-bound-on-steps",
    "nothing says how far `{name}` moves in a step",
    help="write `require speed({name}) <= 20 cm/s`, or hold it in place",
)
NOT_FOR_MOTIONS = Kind(
    "not-for-motions",
    "{argument:argument} is not for specs over time",
    help="leave it out",
)
NOT_ONE_MOTION = Kind(
    "not-one-motion",
    (
        "{path} would show one motion, and there are {count:,}",
        "{path} would show a motion, and {file} holds scenes",
    ),
    help=(
        "{count:?}choose one with <motion>, or name a folder and draw the figures gif or mp4 of all",
        "`scenegen sample` draws motions of a spec with `time`; `--figure gif` animates how a layout is solved",
    ),
)
