"""Errors about time: horizons, windows, and specs over time where scenes are wanted."""

from __future__ import annotations

from scenegen.errors.diagnostic import NEAREST, Kind

TIME_MISSING = Kind(
    "time-missing",
    ("`{word}` is about time, and this spec has none", "`moves` is about steps, and this spec has none"),
    "{word:?}every scene stands by itself",
    (
        "{word:?}say how long a motion lasts: time 20 steps, or time [0, 10 s] every 0.5 s",
        "say how long a motion lasts: time 20 steps",
    ),
    formerly=("moves-without-time",),
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
    formerly=("not-from-zero",),
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
    formerly=("empty-window", "window-in-the-past", "window-beyond", "no-window-here"),
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
    formerly=("choice-over-time", "numbers-over-time"),
)
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
NO_SUCH_MOTION = Kind(
    "no-such-motion",
    "there is no motion {number}",
    help=("{last:?}{file} holds the motions {first} to {last}", "{file} holds a single one, without a number"),
)
MOTION_HAS_ENDED = Kind(
    "motion-has-ended",
    "the motion has ended: its {moments:,} moments were added, the last at {end:g} s",
    help="call reset() before another motion begins",
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
    formerly=("unknown-time-word", "unknown-movers"),
)
NOT_A_TRAJECTORY = Kind(
    "not-a-trajectory",
    "{file} is not a trajectory: {reason}",
    help="a trajectory is a table (.csv, .jsonl, .parquet) with the columns t, mug.x, mug.y, mug.theta",
)
TRAJECTORY_TIMES = Kind(
    "trajectory-times",
    (
        "{file}: time goes from {before:g} s to {time:g} s in row {row}",
        "{file}: row {row} is at {found:g} s, and this moment of the spec is at {wanted:g} s",
        "{file} has the time from {first:g} s to {last:g} s, and motions of the spec go from 0 s to {end:g} s",
        "{file} has {rows:,} rows, and motions of the spec have {moments:,} moments",
    ),
    help=(
        "{before:?}sort the rows by time, and keep one for each",
        "{found:?}with <resample> poses between rows are interpolated",
        "{first:?}record all of it, or let `time` end earlier",
        "let `time` last longer; with <resample> rows beyond its end are not looked at",
    ),
    formerly=("trajectory-order", "trajectory-ends", "trajectory-too-long"),
)
TRAJECTORY_START = Kind(
    "trajectory-start",
    "{file}: its first row, at {start:.12g} s, counts as the moment 0",
    severity="note",
)


# --------------------------------------------------------------------------------------------------------------------
# Errors of motions: their files, and pairs of a start and a goal.


NOT_MOTIONS = Kind("not-motions", "{file} is not a motions file: {reason}", help="`scenegen pairs` writes one")
DAMAGED_MOTIONS = Kind(
    "damaged-motions", "{file} is damaged[[ at `{place}`]]: {reason}", help="`scenegen pairs` writes another one"
)
NO_HEADER_IN_CSV = Kind(
    "no-header-in-csv",
    "{path} holds numbers alone: a .csv file has no place for spec and shapes",
    help="write .json, .jsonl or .parquet",
)
TOO_FEW_PAIRS = Kind(
    "too-few-pairs",
    "found {found:,} of {wanted:,} pairs[[ with {counted}]]: {reason}",
    help="ask for a wider range of starts, for another number of moved objects, or for more time",
)
CANNOT_MOVE_SO_MANY = Kind(
    "cannot-move-so-many",
    "{wanted} objects cannot move: {free} of them can",
    help="ask for {most} at most",
)
NO_BOUND_ON_STEPS = Kind(
    "no-bound-on-steps",
    "nothing says how far `{name}` moves in a step",
    help="write `require speed({name}) <= 20 cm/s`, or hold it in place",
)
TOO_FEW_MOTIONS = Kind(
    "too-few-motions",
    "found {found:,} of {wanted:,} motions: {reason}[[; {folder} keeps what is done: go on with <resume>]]",
    help="ask for another range or for more time, or let objects move faster or in more steps",
)
NOT_FOR_MOTIONS = Kind(
    "not-for-motions",
    "{argument:argument} is not for specs over time",
    help="leave it out",
)
NO_MOTION_SATISFIES = Kind(
    "no-motion-satisfies",
    "no motion that satisfies `{name}` was found",
    help="let objects move faster or in more steps, or change one of its parts",
    severity="warning",
)
NO_MOTION_MEETS = Kind(
    "no-motion-meets",
    "no motion was found that meets what the spec requires, in {evaluations:,} evaluations",
    help="require less, let objects move farther in a step, or make the workspace larger",
    note="[[the best one misses it by {misses:.4g}]]",
)
WHICH_MOTION = Kind(
    "which-motion",
    "{path} would show one motion, and there are {count:,}",
    help="choose one with <motion>, or name a folder and draw the figures gif or mp4 of all",
)
NOT_ONE_MOTION = Kind(
    "not-one-motion",
    "{path} would show a motion, and {file} holds scenes",
    help="`scenegen sample` draws motions of a spec with `time`; `--figure gif` animates how a layout is solved",
)
