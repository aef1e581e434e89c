"""Sets of a plan that costs nothing."""

import hashlib

from made import SHA, Made, header_of

from scenegen.sampling.engine.engines import Local, ShardWriter
from scenegen.sampling.engine.sets import write_set
from scenegen.scenes.sets import Manifest, header_data
from scenegen.scenes.stores import store_at

BLOCK, SHARD, COUNT = 300, 600, 2000
MADE = {}  # what is different from `Made`


def request_of(plan):
    return {
        "spec": SHA,
        "phi": {"task": [plan.low, 0.9]},
        "spread": plan.spread,
        "seed": 0,
        "scenegen": "",
        "numpy": "",
    }


def run(folder, engine=None, store=None, wanted=COUNT, made=MADE, **options):
    plan, place = Made(wanted, **made), store_at(f"{folder}/") if store is None else store
    manifest = Manifest(
        request={**request_of(plan), "n": wanted, "plan": plan.plan_digest},
        labels=["task"],
        shard_size=SHARD,
        header=header_data(header_of(plan)),
    )
    writing = ShardWriter(plan, place, header_of(plan), ("task",))
    account = lambda tally: {"method": "made", "pieces": tally.pieces}  # noqa: E731
    return write_set(place, plan, engine or Local(1), manifest, writing, account, block=BLOCK, **options)


def digest(folder):
    return {one.name: hashlib.sha256(one.read_bytes()).hexdigest() for one in sorted(folder.iterdir()) if one.is_file()}
