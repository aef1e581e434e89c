"""Errors outside of the work itself: the command line, processes, memory, the machine."""

from __future__ import annotations

from scenegen.errors.diagnostic import NEAREST, Kind

COMMAND_LINE = Kind("command-line", "{message}", help="see `{command} --help`")
UNKNOWN_CODE = Kind(
    "unknown-code",
    "nothing here is called `{name}`",
    help=("did you mean `{nearest}`?", "`scenegen explain` lists what can be explained"),
)
OUT_OF_MEMORY = Kind("out-of-memory", "there is not enough memory for this", help="ask for fewer scenes at a time")
INTERNAL_ERROR = Kind(
    "internal-error",
    "scenegen itself failed: {error}",
    help="this is a bug; please report it with the traceback that `--debug` shows",
)
CANNOT_START_PROCESS = Kind(
    "cannot-start-process",
    "cannot start {what}: {reason}",
    help="end other programs, or ask for fewer <workers>; `ulimit -a` shows how much you may have at a time",
)
PROCESS_DIED = Kind(
    "process-died",
    ("{what} {how} at {unit} {item}, and so did another one before", "{what} {how} before it began"),
    help="{remedy}",
    note="{said}",
)
NOT_CONNECTED = Kind(
    "not-connected", "PyBullet client {client} is not connected", help="pass what pybullet.connect(...) returned"
)
NO_EGL = Kind("no-egl", "this pybullet has no EGL renderer", help="leave `<renderer=egl>` out")

# notes
NOT_ITS_MODEL = Kind(
    "not-its-model",
    ("no picture for {blocks:quoted}: drawn as blocks", "drawn as outlines: {outlines:quoted}"),
    help=(
        "{blocks:?}`scenegen assets` lists what there is",
        "{outlines:?}`<meshes>` draws .glb, .gltf, .obj and .stl meshes and URDF files",
    ),
    severity="note",
)
OTHER_FILES = Kind("other-files", "{files} scene_*{ending} in {folder} {verb} not of these scenes", severity="note")
PHI_NOT_COMPARED = Kind(
    "phi-not-compared", "{file} was made from another spec; its stored phi was not compared", severity="note"
)
INTERRUPTED = Kind(
    "interrupted",
    "interrupted[[; {folder} keeps {scenes:,} scenes: go on with <resume>]]",
    severity="note",
)
TRAINING_INTERRUPTED = Kind(
    "training-interrupted",
    (
        "{late:?}time is up after {done} of {epochs} epochs; go on with `<resume=True> <out={path}>`",
        "interrupted while {account}; {kept:,} scenes are kept in {path}; go on with `<resume=True>`",
        "interrupted while {account}; nothing was written",
        "stopped after {done} of {epochs} epochs; go on with `<resume=True> <out={path}>`",
    ),
    severity="note",
)
TRAINING_DONE = Kind(
    "training-done",
    (
        "stopped after {epochs} epochs: no better than epoch {best}, which is kept (mean error of phi {error:.4g})",
        "{epochs} epochs are already done; to train on, ask for more with <epochs>",
    ),
    severity="note",
)
NEW_RATE = Kind(
    "new-rate",
    "the learning rate follows the plan of {epochs} epochs from here on, no longer that of {before}",
    severity="note",
)


NOT_OPENED = Kind(
    "not-opened",
    ("cannot open {name}: there is no such file", "cannot open {file}: {reason}"),
    help=(NEAREST, "{known:?}name a spec, a scene file, a model or a folder; `scenegen specs` lists specs"),
)
SERVED_IN_PUBLIC = Kind(
    "served-in-public",
    "the page is served on {host}: other machines can reach it, over a connection that is not encrypted",
    help="give its link only to people whom you trust",
    severity="warning",
)
CANNOT_LISTEN = Kind(
    "cannot-listen",
    "cannot listen on {host}:{port}: {reason}",
    help="leave --port out: any free one is taken then",
)
NO_MESSAGE = Kind("no-message", "the server does not know what to do with this: {reason}", help="reload the page")
PAGE_LIMIT = Kind(
    "page-limit",
    (
        "the page would have {size:.0f} MB",
        "the page shows 1 to {most} {what} of these objects, not {count:,}",
        "a motion of {poses:,} poses, each object's at each moment, is too long for the page: {most:,} are the most",
        "a motion of {moments:,} moments takes too long to be drawn here: {most} are the most",
    ),
    help=(
        "{size:?}ask for fewer scenes with -n",
        "{what:?}`scenegen sample` makes as many as you like",
        "{poses:?}`scenegen sample` draws it; on the page take fewer steps",
        "{moments:?}`scenegen render MOTIONS --out x.gif` draws it",
    ),
)
ANOTHER_SPEC = Kind(
    "another-spec",
    "the model was trained on another spec than the one in the editor",
    help="choose another method, or bring the model's spec back",
)
