"""What is wrong with files: scenes that cannot be read or written, formats, worlds for simulators."""

from __future__ import annotations

from scenegen.errors.diagnostic import NEAREST, Kind

_SAMPLE = "make one with `scenegen sample`"

# reading and writing
CANNOT_READ = Kind(
    "cannot-read",
    ("cannot read {file} in {location}: {reason}", "cannot read {path}: {reason}"),
    help="{remedy}",
)
TOO_LARGE_TO_READ = Kind(
    "too-large-to-read",
    (
        "a row group of {path} holds {size:,} {unit}; the limit is {limit:,}",
        "cannot read {path}: {size:,} bytes are too many",
    ),
    help=("{unit:?}{remedy}", "the limit is {limit:,}[[; {remedy}]]"),
)
BAD_LOOKS = Kind(
    "bad-looks",
    "[[{key}: ]]{reason}",
    help="`scenegen explain pictures` shows what looks are; `<looks=random>` ships with scenegen",
)
SPEC_NOT_FOUND = Kind(
    "spec-not-found",
    (
        "cannot read {path}: there is no file {path}, nor {path}.spec",
        "no spec of this name ships with scenegen: {name}",
    ),
    help=(
        "{path:?}did you mean `{nearest}`, which ships with scenegen?",
        NEAREST,
        "{remedy}; `scenegen specs` lists those that ship with scenegen",
        "`scenegen specs` lists them",
    ),
)
CANNOT_WRITE = Kind(
    "cannot-write",
    (
        "cannot write {file} in {location}: {reason}[[, tried {tries} times in {seconds:.0f} s]]",
        "cannot write {path}: {reason}",
        "cannot write to standard output: {reason}",
    ),
    help=(
        "{full:?}the disk is full; {folder} keeps {scenes:,} scenes: make room, go on with <resume>",
        "{folder} keeps {scenes:,} scenes: mend that, then go on with <resume>",
        "{location:?}{remedy}; what is complete stays there, and <resume> goes on",
        "{remedy}",
        "name a file with <out>",
    ),
)

# formats
UNKNOWN_ENDING = Kind(
    "unknown-ending",
    (
        "{path} has the ending `{name}`: not a format of {what} files",
        "{path} has no ending of a format of {what} files",
    ),
    help=(
        "sample to {scenes}, then: `scenegen export {scenes} <out={path}>`",
        "{instead}",
        NEAREST,
        "use {known:list}",
    ),
)
WRONG_ENDING = Kind(
    "wrong-ending",
    "{path} does not end in {ending}[[, which {format} files do]]",
    help="name it {better}[[, or leave {leave:argument} out]]",
)
ENDING_OF_ANOTHER = Kind("ending-of-another", "{path} has the ending of {other}, not of {format}", help="{places}")
NO_FORMAT = Kind(
    "no-format",
    "no format was given, and {path} does not tell it by its ending",
    help=("{instead}", "say which with <to>: {known:list}"),
)

# scene files
NOT_JSON = Kind("not-json", "{file} is not valid JSON", "{reason}", _SAMPLE)
NOT_SCENES = Kind(
    "not-scenes",
    "{file} is not a scenes file: {reason}",
    help=(
        "{poses:?}if it holds poses alone, name their spec with <spec>",
        "this scenegen reads version {version}",
        _SAMPLE,
    ),
)
DAMAGED_SCENES = Kind(
    "damaged-scenes",
    "{file} is damaged[[ at `{place}`]]: {reason}[[ ({more} more problems)]]",
    help=("{place:?}counting starts at 1", _SAMPLE),
)
OTHER_OBJECTS = Kind(
    "other-objects",
    (
        "{scene} has no pose for `{missing}`",
        "{scene} does not place the file's objects: `{odd}`",
        "{scene} does not place the objects of its spec",
    ),
    help="every scene places {wanted:quoted}",
)
OTHER_SURFACE = Kind(
    "other-surface",
    (
        "{scene} has `{name}` on `{surface}`, which the file's header does not have",
        "{scene} does not say on which of its surfaces `{name}` stands",
    ),
    help='write "on": one of {known:list}',
)
NO_SURFACE_GIVEN = Kind(
    "no-surface-given",
    "the scenes do not say on which surface of the spec `{name}` stands",
    help="sample scenes of this spec",
)
OTHER_LABELS = Kind(
    "other-labels",
    "{scene} has other labels than {whose}",
    help="{whose} has {labels:quoted}",
)
BAD_LINE = Kind(
    "bad-line",
    ("{line} is longer than {limit:,} bytes", "{line} is empty"),
    help="every line after the first is a scene",
)
DAMAGED_PARQUET = Kind("damaged-parquet", "{path} is damaged, or no Parquet file", help=_SAMPLE, note="{reason}")
WRONG_COLUMNS = Kind(
    "wrong-columns",
    (
        "{twice:?}{path} has two columns `{name}`",
        "column `{name}` of {path} holds {found}, not float64",
        "{path} has no column `{name}`",
    ),
    help=("it needs {wanted:quoted}, and phi of each label; what else it has is not read", _SAMPLE),
)
COLUMN_NOT_A_NUMBER = Kind(
    "column-not-a-number",
    "{path} is damaged: no number stands in column `{column}` of scene {scene}",
    help=("{own:?}every x, y and theta is a finite number", _SAMPLE),
)
TABLE_COLUMN = Kind(
    "table-column",
    "{file} has no column `{name}`",
    help=("missing are {missing:list}[[; its columns are {known:list}]]", NEAREST, "its columns are {known:list}"),
)
TABLE_ROW = Kind(
    "table-row",
    "{file}: row {row} has {given} values, not {wanted}",
    help="a row has a value for every column; numbers have a decimal point, and `,`, `;` or a tab stands between them",
)
TABLE_CELL = Kind(
    "table-cell",
    "{file}: `{name}` in row {row} is `{value}`, not a finite number",
    help="numbers have a decimal point: {point}",
)
TABLE_UNUSED = Kind("table-unused", "{file} has columns that the spec does not need: {columns:list}", severity="note")
DOUBTFUL_POSE = Kind(
    "doubtful-pose",
    ("{file}: `{name}` in row {row} is {value:g}: {doubt}", "{file}: `{name}` is {value:g}: {doubt}"),
    help="{remedy}",
    severity="warning",
)
COLUMN_TWICE = Kind(
    "column-twice",
    "two columns of the table would have the name `{name}`",
    help="rename the object `phi`, or write .jsonl",
)
TOO_MANY_TO_READ = Kind(
    "too-many-to-read",
    "{file} holds {count} scenes of {objects} objects: too many for memory",
    help="at most {most:,} of them are read at once; in Python, scenegen.read_scenes(path, stop={most}) reads a part. "
    "`scenegen export` makes other scene files of any number, block by block",
)
NO_WORLD = Kind(
    "no-world",
    (
        "`{name}` stands {distance:.3g} m off the workspace in scene {scene}",
        "an object's name {reason}: {name}",
        "`{name}` has no volume",
    ),
    help=(
        "no table is that large: {limit:g} m are the most",
        "rename it in the spec{reason:?}",
        "give it a wider outline",
    ),
)
TOO_LARGE_TO_WRITE = Kind(
    "too-large-to-write",
    (
        "these scenes do not fit into one file, which is made in memory: the first {most:,} do",
        "these scenes do not fit into a .json file of {limit:,} bytes, the most that can be read",
    ),
    help=(
        "{most:?}name a folder, which gets a file for each scene",
        "write .jsonl or .parquet, of which readers need a part at a time",
    ),
)
SIZE_IN_FILE = Kind(
    "size-in-file",
    ("{what} is {size:.3g} m {how}", "{what} is empty"),
    help="{limits}",
)
UNUSABLE_MODEL = Kind(
    "unusable-model",
    (
        "{path}, the file of `{name}`, gives it no body: {reason}{body:?}",
        "{path}, the mesh of `{name}`, cannot be drawn: {reason}",
    ),
    help=(
        "`<meshes>` is the folder that the spec was in; without it the body is a prism over the outline{body:?}",
        "`<meshes>` is the folder that the spec was in; without it the outline is drawn",
    ),
)
NO_MODEL = Kind(
    "no-model",
    "no object of the scenes is from a mesh, an asset of an index or a URDF file",
    help='`object mug = mesh("mug.glb")` is; `asset` and `urdf` objects are, too',
)
NO_ARM = Kind(
    "no-arm",
    "{file} has no arm to measure: {reason}",
    help=("{remedy}", "a URDF file has the links and joints of a robot; xacro files are expanded first"),
)
# scenes and their spec
OTHER_SPEC = Kind(
    "other-spec",
    "these scenes are not of this spec: {reason}",
    help="the spec is about {wanted:quoted}, the scenes are about {found:quoted}",
)
HELD_ELSEWHERE = Kind(
    "held-elsewhere",
    (
        "`{name}` is held at ({pose}) by the spec, but stands elsewhere in scene {scene}",
        "`{name}` is held at ({pose}) by the spec, but stands elsewhere {place}",
    ),
    help="take the `at` of `{name}` out of the spec to score it where it is",
)
SCENE_NOT_ALLOWED = Kind(
    "scene-not-allowed",
    ("`{name}` is outside of the workspace in scene {scene}", "scene {scene} does not meet what the spec requires"),
    help="use scenes that were sampled from this spec",
)
PHI_DIFFERS = Kind(
    "phi-differs",
    (
        "scene {scene} of {file} stores phi of `{label}` as {stored:.9g}; it is {computed:.9g}",
        "{unknown:?}{file} stores phi of `{label}`, a label that its spec does not have",
        "{file} stores no phi of `{label}`",
    ),
    help=("{count} scenes are off; sample them again", "sample the scenes again"),
)

# unfinished runs
UNFINISHED_RUN = Kind(
    "unfinished-run",
    ("{folder} holds {outcomes:,} outcomes already", "{folder} holds {scenes:,} scenes of an unfinished run"),
    help=(
        "{outcomes:?}go on with <resume>, or name another file",
        "{older:?}an earlier version of scenegen wrote it: end the run with that one, or delete the folder",
        "go on with <resume>, or delete the folder",
    ),
)
OTHER_REQUEST = Kind(
    "other-request",
    "{folder} is of another request: `{key}` was {before}, and is {now} now",
    help=(
        "{outcomes:?}ask for the same again, or name another file",
        "ask for the same again, or delete the folder",
    ),
)


UNKNOWN_STORE = Kind(
    "unknown-store",
    "cannot open {location}: {reason}",
    help="use a folder, or a URL as s3://bucket/set/, gs://bucket/set/ or hdfs://host/set/",
)
SET_IN_USE = Kind(
    "set-in-use",
    "another run is writing {location}[[: process {pid} on {host}]]",
    help="wait for it, or name another place",
)
NOT_A_SET = Kind("not-a-set", "{location} is not a set of scenes: {reason}", help="{remedy}")
DAMAGED_SHARD = Kind(
    "damaged-shard",
    (
        "{path} is damaged: it cannot be resumed",
        "{count} of {total} shards are damaged: {file}: {reason}",
        "{file} in {location} is damaged: {reason}",
    ),
    help=(
        "delete {folder}, and start again",
        "make the set again in another folder; its request is in manifest.json",
    ),
)
FINISHED_SET = Kind("finished-set", "{location} has a set of scenes already", help="choose another folder")
FOLDER_NOT_EMPTY = Kind(
    "folder-not-empty",
    (
        "{folder} is in the way: it holds `{odd}`, which is not of an unfinished run",
        "{location} has other files: {odd}",
    ),
    help=("{folder:?}move it, or name another output file", "choose an empty folder, or one that does not exist"),
)
SHARD_SIZE = Kind(
    "shard-size",
    "a shard cannot have {size:,} scenes",
    help="give a multiple of {block:,}[[; for {objects} objects at most {most:,}]]",
)
ONLY_FOR_SETS = Kind(
    "only-for-sets", "{argument:argument} needs a set of scenes", help="end <out> with a slash: <out=DIR/>"
)
UNKNOWN_ENGINE = Kind("unknown-engine", "there is no engine `{name}`", help=(NEAREST, "use {known:list}"))
ADDRESS_WITHOUT_RAY = Kind(
    "address-without-ray", "<address> is that of a Ray cluster", help="add <engine=ray>, or leave it out"
)
CLUSTER_NOT_FOUND = Kind(
    "cluster-not-found",
    "cannot reach the Ray cluster[[ at {address}]]: {reason}",
    help="start one with `ray start --head`, or leave <address> out to use this machine",
)
CLUSTER_FAILED = Kind(
    "cluster-failed",
    "the Ray cluster failed at {what}: {reason}",
    help="complete shards stay where they are; go on with <resume> when the cluster runs again",
)
FOLDER_FOR_SEVERAL = Kind(
    "folder-for-several",
    "{count} inputs need a folder for what is made of them",
    help="end <out> with a slash: <out=DIR/>; or give one at a time",
)
ONLY_FOR_SEVERAL = Kind(
    "only-for-several",
    "{argument:argument} is for several inputs, which are jobs of their own",
    help="leave it out: the processes of this machine share the work on one",
)
SAME_NAME = Kind(
    "same-name",
    ("two {objects} have the name `{name}`", "two of the inputs are called `{name}`"),
    help=(
        "{objects:?}give each a name of its own in `names`",
        "give them one at a time, or rename one of the files",
    ),
)
SOME_FAILED = Kind(
    "some-failed", "{failed:list} failed; the others of {count} are done", help="see what is said of each above"
)
SETS_DIFFER = Kind(
    "sets-differ", "{one} and {other} cannot be merged: their {what} differ", help="merge sets of one spec"
)
NOTHING_LEFT = Kind(
    "nothing-left", "no scene of {location} is in the range", help="`scenegen data` shows what phi it has"
)
SHARES = Kind(
    "shares",
    "{shares} cannot be the shares of a split",
    help="give shares above 0 that are at most 1 together",
)
DATA_ARGUMENTS = Kind("data-arguments", "`scenegen data {action}` needs {wanted}", help="see `scenegen data --help`")
NO_PART = Kind(
    "no-part", "there are no scenes for a data set: {missing:list}", help="`scenegen range SPEC` shows what phi can be"
)
NO_SEED = Kind(
    "no-seed",
    "the shards of {location} follow from one request, each from those before it",
    help="make the set again in another folder; its request is in manifest.json",
)
REMADE_DIFFERS = Kind(
    "remade-differs",
    "{file} of {location} comes out with other bytes than its manifest says; nothing was written",
    help="use the versions of then: scenegen {scenegen}, numpy {numpy}, and the same pyarrow",
)

# motions and trajectories
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
)
TRAJECTORY_START = Kind(
    "trajectory-start",
    "{file}: its first row, at {start:.12g} s, counts as the moment 0",
    severity="note",
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
