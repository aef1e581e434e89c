"""Errors outside of the work itself: the command line, processes, memory, the machine."""

from __future__ import annotations

from scenegen.errors.diagnostic import Kind

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
NO_PICTURE = Kind(
    "no-picture",
    "no picture for {names:quoted}: drawn as blocks",
    help="`scenegen assets` lists what there is",
    severity="note",
)
STILL_OUTLINES = Kind(
    "still-outlines",
    "drawn as outlines: {names:quoted}",
    help="`<meshes>` draws .glb, .gltf, .obj and .stl meshes and URDF files",
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
        "interrupted while {account}; {kept:,} scenes are kept in {path}; go on with `<resume=True>`",
        "interrupted while {account}; nothing was written",
        "stopped after {done} of {epochs} epochs; go on with `<resume=True> <out={path}>`",
    ),
    severity="note",
)
TIME_IS_UP = Kind(
    "time-is-up",
    "time is up after {done} of {epochs} epochs; go on with `<resume=True> <out={path}>`",
    severity="note",
)
ALREADY_DONE = Kind(
    "already-done", "{epochs} epochs are already done; to train on, ask for more with <epochs>", severity="note"
)
STOPPED_EARLY = Kind(
    "stopped-early",
    "stopped after {epochs} epochs: no better than epoch {best}, which is kept (mean error of phi {error:.4g})",
    severity="note",
)
NEW_RATE = Kind(
    "new-rate",
    "the learning rate follows the plan of {epochs} epochs from here on, no longer that of {before}",
    severity="note",
)
