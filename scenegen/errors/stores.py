"""What is wrong with sets of scenes: folders on a disk or in an object store, and the engines that write them."""

from __future__ import annotations

from scenegen.errors.diagnostic import NEAREST, Kind

UNKNOWN_STORE = Kind(
    "unknown-store",
    "cannot open {location}: {reason}",
    help="use a folder, or a URL as s3://bucket/set/, gs://bucket/set/ or hdfs://host/set/",
)
CANNOT_READ_STORE = Kind("cannot-read-store", "cannot read {file} in {location}: {reason}", help="{remedy}")
CANNOT_WRITE_STORE = Kind(
    "cannot-write-store",
    "cannot write {file} in {location}: {reason}[[, tried {tries} times in {seconds:.0f} s]]",
    help="{remedy}; what is complete stays there, and <resume> goes on",
)
NOT_A_SET = Kind("not-a-set", "{location} is not a set of scenes: {reason}", help="{remedy}")
DAMAGED_SHARD = Kind(
    "damaged-shard",
    "{file} in {location} is damaged: {reason}",
    help="make the set again in another folder; its request is in manifest.json",
)
FINISHED_SET = Kind("finished-set", "{location} has a set of scenes already", help="choose another folder")
FOLDER_NOT_EMPTY = Kind(
    "folder-not-empty", "{location} has other files: {odd}", help="choose an empty folder, or one that does not exist"
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
    "same-name", "two of the inputs are called `{name}`", help="give them one at a time, or rename one of the files"
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
FAULTY_SHARDS = Kind(
    "faulty-shards",
    "{count} of {total} shards are damaged: {file}: {reason}",
    help="make the set again in another folder; its request is in manifest.json",
)
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
