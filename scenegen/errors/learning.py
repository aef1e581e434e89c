"""What is wrong with environments and curricula."""

from __future__ import annotations

from scenegen.errors.diagnostic import Kind

NO_SCENE_IN_FILE = Kind("no-scene-in-file", "the file has no scene with {wanted}")
NO_MOTION_IN_FILE = Kind(
    "no-motion-in-file",
    "the source has no motion with {wanted}",
    note="only motions that meet what the spec requires count",
    help="draw some with `scenegen sample`, or leave `source` out",
)
MOTIONS_OF_ANOTHER_SPEC = Kind(
    "motions-of-another-spec",
    "these are motions of {found:quoted} over {steps} steps, not of {wanted:quoted} over {horizon}",
    help="draw them from the same spec with `scenegen sample`",
)
NOT_A_FIRST_SCENE = Kind(
    "not-a-first-scene",
    "no motion of this spec begins with this scene: {reason}",
)
DRAW_TOO_SLOW = Kind(
    "draw-too-slow",
    "{problem}",
    help="a draw has {seconds:g} s here; draw scenes with `scenegen sample` first, and give them as `source`",
    note="{note}",
)
LABEL_NOT_THERE = Kind(
    "label-not-there",
    "a curriculum about label {label}, which is not there",
    help="labels are counted from 0 to {last}, in the spec's order",
)
NOT_A_REACH = Kind(
    "not-a-reach",
    "{value} is no reach of phi",
    help="write PhiBox((-0.7,), (0.0,)), or give `env.unwrapped.space`",
)
UNEVEN_REACH = Kind(
    "uneven-reach",
    "a reach of phi with {low} low and {high} high ends",
    help="give one low and one high end per label of the spec",
)
REACH_ENDS = Kind(
    "reach-ends",
    "label {label}: no curriculum from phi {low} to {high}",
    help="both ends are finite, the lower one first; `scenegen range` prints what can be reached",
)
NOT_A_GENERATOR = Kind(
    "not-a-generator",
    "a strategy draws from a numpy.random.Generator, not from {value}",
    help="give np.random.default_rng(0)",
)
TOO_MANY_CELLS = Kind(
    "too-many-cells",
    "{labels} labels with {per} cells each make {count} cells, more than {limit}",
    help="name the labels that matter: labels=[0, 1]",
)
NOT_A_STATE = Kind("not-a-state", "a state is a mapping, not {value}", help="use what state() gave")
OTHER_STATE = Kind(
    "other-state",
    "this state is of another {part}: {found}[[, not {wanted}]]",
    help="restore into a strategy made like the one that was saved",
)
PARTIAL_STATE = Kind("partial-state", "this state is not a whole one of `{strategy}`", help="use what state() gave")

# environments
NO_EPISODE = Kind("no-episode", "{state}", help="{remedy}")
WRONG_ACTION = Kind("wrong-action", "{wanted}, not {value}")
UNKNOWN_ACTION = Kind("unknown-action", "there is no action {number}", help="they are numbered from 0 to {last}")
ACTION_OUT_OF_RANGE = Kind(
    "action-out-of-range",
    ("`{name}` of {whose} is {amount:g}; it has to be from -1 to 1", "`{name}` of {whose} is not a number"),
)
NOTHING_TO_MOVE = Kind("nothing-to-move", "there is no object that can be moved: {reason}", help="free an object")
GOAL_OUT_OF_REACH = Kind(
    "goal-out-of-reach",
    "no scene satisfies the goal `{label}`, so there is nothing to learn",
    help=(
        "phi of `{label}` lies between {lowest:.4g} and {highest:.4g} in this workspace",
        "`scenegen check` names the parts that clash",
    ),
)
GOAL_ALWAYS_MET = Kind(
    "goal-always-met",
    (
        "every scene satisfies the goal `{label}` already, so there is nothing to learn",
        "every scene of the source satisfies the goal already",
    ),
    help=(
        "phi of `{label}` lies between {lowest:.4g} and {highest:.4g} in this workspace",
        "ask for a `phi` to begin with",
    ),
)
NOT_A_TASK = Kind(
    "not-a-task", "{value} is no task", help="a task is a PhiBox with one low and one high number per label"
)
LABELS_OF_TASK = Kind("labels-of-task", "the task has phi of {count} labels", help="the spec has {labels:quoted}")
NOT_POSES = Kind(
    "not-poses",
    "a scene is a Scene, a pose for each object, or an array ([[{objects}, ]]3); {found}",
    help="write a row (x, y, theta) for each object",
)
NUMBER_OF_SEEDS = Kind(
    "number-of-seeds", "there are {seeds} seeds for {tables} tables", help="give one, or one for each"
)
SOURCE_OF_ANOTHER_SPEC = Kind(
    "source-of-another-spec",
    "the model {model} was trained on another spec",
    help="make the environment from that one",
)
NOT_A_STRATEGY = Kind(
    "not-a-strategy",
    "{value} is no strategy",
    help='make one: strategy("self_paced", env.unwrapped.space, np.random.default_rng(0))',
)
STRATEGY_OUT_OF_REACH = Kind(
    "strategy-out-of-reach",
    "the strategy is about phi from {low:.4g} to {high:.4g} of label {label}, but starts here have {least:.4g} to "
    "{most:.4g}",
    help="make it for `env.unwrapped.space`",
)
NOT_AN_ENVIRONMENT = Kind("not-an-environment", "a curriculum goes around a {wanted}, not around a {found}")
WRONG_AUTORESET = Kind(
    "wrong-autoreset", 'Stable-Baselines3 needs an environment with autoreset_mode="SameStep", not {mode}'
)
ONE_ENVIRONMENT = Kind(
    "one-environment", "{what} {verb} single tables, which is not possible: they are one environment"
)
