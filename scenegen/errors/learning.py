"""What is wrong with environments and curricula."""

from __future__ import annotations

from scenegen.errors.diagnostic import Kind

NO_START_IN_FILE = Kind(
    "no-start-in-file",
    "the file has no scene with {wanted}",
)
DRAW_TOO_SLOW = Kind(
    "draw-too-slow",
    "{problem}",
    help="a draw has {seconds:g} s here; draw scenes with `scenegen sample` first, and give them as `source`",
    note="{note}",
)
NOT_A_REACH = Kind(
    "not-a-reach",
    (
        "label {label}: no curriculum from phi {low} to {high}",
        "a reach of phi with {low} low and {high} high ends",
        "{value} is no reach of phi",
    ),
    help=(
        "{label:?}both ends are finite, the lower one first; `scenegen range` prints what can be reached",
        "{low:?}give one low and one high end per label of the spec",
        "write PhiBox((-0.7,), (0.0,)), or give `env.unwrapped.space`",
    ),
)
TOO_MANY_CELLS = Kind(
    "too-many-cells",
    "{labels} labels with {per} cells each make {count} cells, more than {limit}",
    help="name the labels that matter: labels=[0, 1]",
)
NOT_A_STATE = Kind(
    "not-a-state",
    (
        "this state is of another {part}: {found}[[, not {wanted}]]",
        "this state is not a whole one of `{strategy}`",
        "a state is a mapping, not {value}",
    ),
    help=("{part:?}restore into a strategy made like the one that was saved", "use what state() gave"),
)

# environments
NO_EPISODE = Kind("no-episode", "{state}", help="{remedy}")
WRONG_ACTION = Kind(
    "wrong-action",
    (
        "there is no action {number}",
        "`{name}` of {whose} is {amount:g}; it has to be from -1 to 1",
        "`{name}` of {whose} is not a number",
        "{wanted}, not {value}",
    ),
    help=("{number:?}they are numbered from 0 to {last}",),
)
NOTHING_TO_MOVE = Kind("nothing-to-move", "there is no object that can be moved: {reason}", help="free an object")
NO_UNMET_GOAL = Kind(
    "no-unmet-goal",
    (
        "{always:?}every scene satisfies the goal `{label}` already, so there is nothing to learn",
        "no scene satisfies the goal `{label}`, so there is nothing to learn",
        "every scene of the source satisfies the goal already",
    ),
    help=(
        "phi of `{label}` lies between {lowest:.4g} and {highest:.4g} in this workspace",
        "{label:?}`scenegen check` names the parts that clash",
        "ask for a `phi` to begin with",
    ),
)
NOT_A_TASK = Kind(
    "not-a-task",
    ("the task has phi of {count} labels", "{value} is no task"),
    help=("the spec has {labels:quoted}", "a task is a PhiBox with one low and one high number per label"),
)
NOT_POSES = Kind(
    "not-poses",
    "a scene is a Scene, a pose for each object, or an array ([[{objects}, ]]3); {found}",
    help="write a row (x, y, theta) for each object",
)
STRATEGY_OUT_OF_REACH = Kind(
    "strategy-out-of-reach",
    "the strategy is about phi from {low:.4g} to {high:.4g} of label {label}, but starts here have {least:.4g} to "
    "{most:.4g}",
    help="make it for `env.unwrapped.space`",
)
ONE_ENVIRONMENT = Kind(
    "one-environment", "{what} {verb} single tables, which is not possible: they are one environment"
)


# training data
TOO_RARE_TO_TRAIN = Kind(
    "too-rare-to-train",
    (
        "only {found:,} of {wanted:,} scenes for a balanced set can be reached",
        "no positives to boost from: none of {draws:,} uniform scenes satisfies every label",
        "what is required was met by {found:,} of {tried:,} uniform scenes: too rare for plain draws",
    ),
    help=(
        "{wanted:?}ask for fewer <scenes>, or train on `<data=uniform>`",
        "{draws:?}check that the spec can be satisfied, widen its tolerances, or train on `<data=uniform>`",
        "train on `<data=balanced>`",
    ),
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
NO_TIME_TO_TRAIN = Kind(
    "no-time-to-train",
    (
        "{out:?}time was up after {seconds:g} s, in the first epoch",
        "time was up after {seconds:g} s of {account}; {kept:,} scenes are kept in {path}",
        "time was up after {seconds:g} s of {account}; nothing was written",
    ),
    help=(
        "go on with `<resume=True> <out={out}>`, and give it more time with <timeout>",
        "[[{kept:?}go on with `<resume=True>`, or ]]give it more time with <timeout>, ask for fewer <scenes>, "
        "or train on `<data=uniform>`",
    ),
)
UNKNOWN_TO_MODEL = Kind(
    "unknown-to-model",
    (
        "{usually:?}this model knows no spec that says where things usually are",
        "the weights of this model do not know {names:quoted}, of which the formula is made",
    ),
    help="draw exact scenes, or train a model of the spec",
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
DATA_CHANGED = Kind(
    "data-changed",
    ("{path} has changed since the training began", "cannot resume: the training data {what}"),
    help=(
        "{path:?}start again",
        "the file, or the version of scenegen or torch, has changed; start again without <resume>",
    ),
)

# training runs
UNKNOWN_DEVICE = Kind(
    "unknown-device",
    ("{missing:?}there is no device `{name}` here", "unknown device `{name}`"),
    help=("{missing:?}write `<device=cpu>`", "write `cpu`, `cuda` or `cuda:1`"),
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
OTHER_OPTION_RESUMED = Kind(
    "other-option-resumed",
    "{argument:argument} was {before} in the run to resume, not {now}",
    help="give the same options again (only <epochs> may change), or leave <resume> out to start again",
)
STATE_MISFIT = Kind("state-misfit", "the training state does not fit this run[[: {reason}]]", help="start again")

# model files
NOT_A_MODEL = Kind("not-a-model", "{path} is not {what}", help="name a file that `scenegen train` wrote")
DAMAGED_MODEL = Kind(
    "damaged-model",
    (
        "[[{path}: ]]the weights `{weights}` {reason}",
        "{path}: model `{model}` cannot have its setting `{name}`",
        "the model file contradicts itself: its {told} are not those of the spec in it",
        "{path} is damaged; it is not {what} that can be used[[: {reason}]]",
    ),
    help="copy it again from where it came from, or train the model again",
)
MODEL_VERSION = Kind(
    "model-version",
    "{path} is of version {found} of the format {format}; this scenegen reads version 1",
    help="update scenegen, or train the model again",
)
MODEL_OF_ANOTHER_SPEC = Kind(
    "model-of-another-spec",
    (
        "{fitted:?}no task of this fit has the objects, the workspace and the success formula of {spec}",
        "{path} was trained on another spec: `{found}`, not `{wanted}`",
        "{state} is of another spec: `{found}`, not `{wanted}`",
        "{folder} holds models of another spec than {spec}",
        "the model {model} was trained on another spec",
    ),
    help=(
        "sample the spec of one of its tasks: {fitted:quoted8}",
        "{path:?}sample the model with its own spec, or train one on the spec given",
        "{state:?}resume with the same spec, or leave <resume> out to start again",
        "{folder:?}train on this spec",
        "make the environment from that one",
    ),
    note="[[the model's spec has SHA-256 {hash_found}, the one given {hash_wanted}]]",
)
POOR_MODEL = Kind(
    "poor-model",
    (
        "[[with {counted}: ]]raw scenes leave out true ones: they cover {covered} (exact scenes: 0.97)",
        "[[with {counted}: ]]raw scenes miss their phi by {missed} on average",
        "[[with {counted}: ]]the model's scenes are not distributed as exact ones: {unlike} (exact scenes: 0.97, 0.05)",
        "[[with {counted}: ]]the model's scenes leave a part out at {where}: {branches}",
    ),
    help="the card of a trained model has the figures; sample the spec itself for exact scenes",
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

# metrics
WRONG_SHAPE = Kind(
    "wrong-shape",
    "{what} of shape {found}",
    help="give {wanted}",
)
ARRAY_NOT_FINITE = Kind(
    "array-not-finite",
    "{what} is not finite",
    help=("{remedy}", "check the scenes for NaN and infinity"),
)
DIFFERENT_OBJECTS = Kind(
    "different-objects",
    "the reference has {reference} objects per scene, the generated scenes {generated}",
    help="compare scenes of the same spec",
)
TOO_FEW_SCENES = Kind(
    "too-few-scenes",
    ("{count} {which} scenes are too few", "{count} scenes are too few: some train, others are held out"),
    help=("this metric needs at least {needed}", "give at least 2 scenes"),
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
