"""Errors of motions: their files, and pairs of a start and a goal."""

from __future__ import annotations

from scenegen.errors.diagnostic import NEAREST, Kind

UNKNOWN_MOTION_ENDING = Kind(
    "unknown-motion-ending",
    (
        "{path} has the ending `{name}`: not a format of motion files",
        "{path} has no ending of a format of motion files",
    ),
    help=(NEAREST, "use {known:list}"),
)
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
    "found {found:,} of {wanted:,} motions: {reason}",
    help="ask for another range or for more time, or let objects move faster or in more steps",
)
NOT_FOR_MOTIONS = Kind(
    "not-for-motions",
    "{argument:argument} is not for specs over time[[: {value} would be a set of shards]]",
    help=("{value:?}name a .jsonl, .json, .parquet or .csv file", "leave it out"),
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
