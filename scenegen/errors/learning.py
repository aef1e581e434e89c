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


# --------------------------------------------------------------------------------------------------------------------
# What is wrong with training data, training runs, model files, and arrays given to metrics.


# training data
TOO_FEW_BALANCED = Kind(
    "too-few-balanced",
    "only {found:,} of {wanted:,} scenes for a balanced set can be reached",
    help="ask for fewer <scenes>, or train on `<data=uniform>`",
)
NOTHING_TO_LEARN = Kind(
    "nothing-to-learn",
    "phi of `{label}` is {value:g} in every scene: there is nothing to learn",
    help="free an object, or drop the label",
)
RARE_SCENES = Kind(
    "rare-scenes",
    "scenes with {what} are rare: {fewer:,} of {count:,} are drawn, which saves time",
    severity="note",
)
NO_POSITIVES = Kind(
    "no-positives",
    "no positives to boost from: none of {draws:,} uniform scenes satisfies every label",
    help="check that the spec can be satisfied, widen its tolerances, or train on `<data=uniform>`",
)
REQUIREMENT_TOO_RARE = Kind(
    "requirement-too-rare",
    "what is required was met by {found:,} of {tried:,} uniform scenes: too rare for plain draws",
    help="train on `<data=balanced>`",
)
NO_TIME_TO_GATHER = Kind(
    "no-time-to-gather",
    (
        "time was up after {seconds:g} s of {account}; {kept:,} scenes are kept in {path}",
        "time was up after {seconds:g} s of {account}; nothing was written",
    ),
    help=(
        "[[{kept:?}go on with `<resume=True>`, or ]]give it more time with <timeout>, ask for fewer <scenes>, "
        "or train on `<data=uniform>`"
    ),
)
TOO_MANY_TO_TRAIN = Kind(
    "too-many-to-train",
    "{path} holds more scenes than fit into memory",
    help="write it as .parquet, which is read part by part",
)
TOO_FEW_IN_FILE = Kind(
    "too-few-in-file",
    "{path} holds {found:,} scenes[[ with {counted}]], fewer than the {wanted:,} of <scenes>",
    help="leave <scenes> out to train on all of them",
)
TOO_FEW_TO_SPLIT = Kind(
    "too-few-to-split",
    "{count} scenes are too few: some train, others are held out",
    help="give at least 2 scenes",
)
DATA_CHANGED = Kind("data-changed", "{path} has changed since the training began", help="start again")
DATA_NAME = Kind(
    "data-name", "<data> is {value}, which is no text", help="rename the file: a model file names it, in UTF-8"
)

# training runs
UNKNOWN_DEVICE = Kind("unknown-device", "unknown device `{name}`", help="write `cpu`, `cuda` or `cuda:1`")
NO_DEVICE = Kind("no-device", "there is no device `{name}` here", help="write `<device=cpu>`")
NO_TIME_FOR_AN_EPOCH = Kind(
    "no-time-for-an-epoch",
    "time was up after {seconds:g} s, in the first epoch",
    help="go on with `<resume=True> <out={path}>`, and give it more time with <timeout>",
)
DIVERGED = Kind(
    "diverged",
    "training diverged in epoch {epoch}: {what} not finite",
    help="lower <lr> (it was {lr:g}); the last good checkpoint, if there was one, is kept",
)
NOTHING_TO_RESUME = Kind(
    "nothing-to-resume",
    "nothing to resume: there is no training state {path}",
    help="name the <out> of the earlier run, or leave <resume> out to start again",
)
OTHER_SPEC_RESUMED = Kind(
    "other-spec-resumed",
    "{path} is of another spec: `{found}`, not `{wanted}`",
    help="resume with the same spec, or leave <resume> out to start again",
)
OTHER_OPTION_RESUMED = Kind(
    "other-option-resumed",
    "{argument:argument} was {before} in the run to resume, not {now}",
    help="give the same options again (only <epochs> may change), or leave <resume> out to start again",
)
OTHER_DATA_RESUMED = Kind(
    "other-data-resumed",
    "cannot resume: the training data {what}",
    help="the file, or the version of scenegen or torch, has changed; start again without <resume>",
)
STATE_MISFIT = Kind("state-misfit", "the training state does not fit this run[[: {reason}]]", help="start again")

# model files
NOT_A_MODEL = Kind("not-a-model", "{path} is not {what}", help="name a file that `scenegen train` wrote")
DAMAGED_MODEL = Kind(
    "damaged-model",
    "{path} is damaged; it is not {what} that can be used[[: {reason}]]",
    help="copy it again from where it came from, or train the model again",
)
MODEL_VERSION = Kind(
    "model-version",
    "{path} is of version {found} of the format {format}; this scenegen reads version 1",
    help="update scenegen, or train the model again",
)
MODEL_SETTING = Kind("model-setting", "{path}: model `{model}` cannot have its setting `{name}`")
WEIGHTS_MISFIT = Kind("weights-misfit", "[[{path}: ]]the weights `{name}` {reason}")
MODEL_OF_ANOTHER_SPEC = Kind(
    "model-of-another-spec",
    "{path} was trained on another spec: `{found}`, not `{wanted}`",
    help="sample the model with its own spec, or train one on the spec given",
    note="the model's spec has SHA-256 {hash_found}, the one given {hash_wanted}",
)
MODEL_CONTRADICTS_ITSELF = Kind(
    "model-contradicts-itself",
    "the model file contradicts itself: its {what} are not those of the spec in it",
    help="train it again",
)
WRONG_PHI_SHAPE = Kind("wrong-phi-shape", "phi has the shape {found}; expected ({labels}, n), one row a label")
SCENES_LEFT_OUT = Kind(
    "scenes-left-out",
    "[[with {counted}: ]]raw scenes leave out true ones: they cover {places} (exact scenes: 0.97)",
    help="the model card has the figures; sample the spec itself for exact scenes",
    severity="warning",
)
PHI_MISSED = Kind(
    "phi-missed",
    "[[with {counted}: ]]raw scenes miss their phi by {places} on average",
    help="the model card has the figures; sample the spec itself for exact scenes",
    severity="warning",
)
UNLIKE_EXACT = Kind(
    "unlike-exact",
    "[[with {counted}: ]]the model's scenes are not distributed as exact ones: {places} (exact scenes: 0.97, 0.05)",
    help="the model card has the figures; sample the spec itself for exact scenes",
    severity="warning",
)
NOT_MEASURED = Kind(
    "not-measured",
    "[[with {counted}: ]]how good the model is at {where} was not measured",
    help="[[a model that is trained with `<phi={one}>` is measured there; ]]sample the spec itself for exact scenes",
    severity="warning",
)
NO_TABLE_OF_PHI = Kind(
    "no-table-of-phi",
    "[[with {counted}: ]]the model file, of scenegen {version}, has no table of how phi is distributed: its scenes "
    "may crowd at an end of the range",
    help="train it again; or give the range two ends",
    severity="warning",
)
BEYOND_TRAINING = Kind(
    "beyond-training",
    "[[with {counted}: ]]the model was trained on phi of `{label}` from {low:.4g} to {high:.4g}; beyond it guesses",
    help="narrow <phi>, or leave <raw> out",
    severity="warning",
)
RAW_BREAKS_REQUIREMENT = Kind(
    "raw-breaks-requirement",
    "[[with {counted}: ]]{broken:,} of {count:,} raw scenes do not meet what the spec requires",
    help="leave <raw> out: every scene is then verified",
    severity="warning",
)
OUTPUT_NOT_FINITE = Kind(
    "output-not-finite", "the model's output is not finite", help="the model file is damaged; train it again"
)

# metrics
WRONG_SHAPE = Kind("wrong-shape", "{what} of shape {found}", help="give {wanted}")
ARRAY_NOT_FINITE = Kind("array-not-finite", "{what} is not finite", help="check the scenes for NaN and infinity")
BAD_COUNTS = Kind("bad-counts", "{what}", help="{remedy}")
TOO_FEW_EXPECTED = Kind(
    "too-few-expected",
    "only {expected:.3g} scenes are expected in one of the {classes} classes",
    help="draw more scenes (5 per class at least), or join classes",
)
DIFFERENT_OBJECTS = Kind(
    "different-objects",
    "the reference has {reference} objects per scene, the generated scenes {generated}",
    help="compare scenes of the same spec",
)
TOO_FEW_SCENES = Kind(
    "too-few-scenes", "{count} {which} scenes are too few", help="this metric needs at least {needed}"
)

# folders of models
FOLDER_OF_MODELS = Kind(
    "folder-of-models",
    "{file} draws how many things there are: it gets a folder of models, one for each number, and {path} is a file",
    help="write <out={folder}/>",
)
NO_MODEL_OF_NUMBER = Kind(
    "no-model-of-number",
    "there is no model of {counted}: {path} is missing",
    help="train again with <resume>, or fix the numbers: <count>",
)
MODEL_FOLDER = Kind("model-folder", "{path} holds models of another spec than {spec}", help="train on this spec")
