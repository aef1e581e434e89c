"""Sets of a plan that costs nothing."""

import hashlib

from made import Made, header_of, request_of

from scenegen.sampling.engine.engines import Local, ShardWriter
from scenegen.sampling.engine.writer import write_set
from scenegen.scenes.sets import Manifest, header_data
from scenegen.scenes.stores import store_at

BLOCK, SHARD, COUNT = 300, 600, 2000
MADE = {}  # what is different from `Made`


def run(folder, engine=None, store=None, wanted=COUNT, made=MADE, **options):
    plan, place = Made(wanted, **made), store_at(f"{folder}/") if store is None else store
    manifest = Manifest(
        request=request_of(plan),
        labels=["task"],
        shard_size=SHARD,
        header=header_data(header_of(plan)),
    )
    writing = ShardWriter(plan, place, header_of(plan), ("task",))
    account = lambda tally: {"method": "made", "pieces": tally.pieces}  # noqa: E731
    return write_set(place, plan, engine or Local(1), manifest, writing, account, block=BLOCK, **options)


def digest(folder):
    return {one.name: hashlib.sha256(one.read_bytes()).hexdigest() for one in sorted(folder.iterdir()) if one.is_file()}
