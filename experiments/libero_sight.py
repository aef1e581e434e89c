"""Starts of LIBERO's tasks by the share of the target that its camera sees, held against LIBERO's own masks.

    MUJOCO_GL=egl python -m experiments.libero_sight OUT.jsonl --suite libero_object --states 50 [--only REGEX]
    python -m experiments.libero_sight OUT.jsonl --table

A line of JSON for each task and share; what is there already is left out. Each state is set in another environment of
LIBERO's, after another seed. The share by masks is that of the target's pixels in the picture of `agentview` (256 x
256) to those that it has there where nothing else is drawn. `sliced` is the share that a spec would have whose things
were stacks of slices of their meshes, as the library's are, instead of prisms.
"""

from __future__ import annotations

import argparse
import json
import re
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from scenegen.api.scene_arrays import make_header
from scenegen.errors import RequestError
from scenegen.geometry import NUMPY
from scenegen.geometry.footprint import Stack
from scenegen.geometry.share import BODY, CAMERA, OTHER
from scenegen.geometry.workspace import wrap_headings
from scenegen.lang.formula.core import Apply, Coord, Core
from scenegen.lang.formula.interpret import phi
from scenegen.libero import init_states, spec_of
from scenegen.play.frame import TableFrame, inverse, times
from scenegen.play.libero.files import LiberoTask, make_environment, tasks_of
from scenegen.play.libero.measure import DRAWN_GROUP, LiveModel, matrix
from scenegen.play.libero.spec import EnvironmentSpec
from scenegen.pose import as_rows
from scenegen.scenes.arrange import with_switches
from scenegen.scenes.data import RequestData
from scenegen.things.mesh import Mesh, join
from scenegen.things.sight import slices_of

SHARES, HALF = (0.9, 0.6, 0.3, 0.1), 0.05  # the middles of ranges, and how far they go
ROUNDING = 1e-9
DIGITS = 5  # of shares
UNDRAWN_GROUP = 5  # of sites: by default MuJoCo draws groups 0 to 2
PIXELS = 256  # from side to side of a picture


def mask_share(env: Any, live: LiveModel, name: str) -> float:
    """The share of a thing's pixels that LIBERO's own mask has, with everything and with the thing alone."""
    others = [one for one in range(live.model.ngeom) if live.model.geom_group[one] == DRAWN_GROUP]
    others = [one for one in others if live.owner(one) != name]

    def count() -> int:
        mask = env.sim.render(camera_name="agentview", width=PIXELS, height=PIXELS, segmentation=True)[..., 1]
        return sum(int((mask == geom).sum()) for geom in np.unique(mask) if geom >= 0 and live.owner(int(geom)) == name)

    seen = count()
    live.model.geom_group[others] = 0  # which is not drawn
    alone = count()
    live.model.geom_group[others] = DRAWN_GROUP
    return seen / alone


def slice_things(own: EnvironmentSpec, live: LiveModel) -> dict[str, Stack]:
    """What moves, as stacks of slices of what is drawn."""
    model, bodies = live.model, {}
    for name in own.spec.objects:
        if name not in live.movers:
            continue
        body, meshes = live.things[name], []
        for geom in range(model.ngeom):
            if model.geom_group[geom] == DRAWN_GROUP and live.owner(geom) == name and model.geom_dataid[geom] >= 0:
                begin, count = (int(of[model.geom_dataid[geom]]) for of in (model.mesh_faceadr, model.mesh_facenum))
                inside = (live.corners(geom) - live.data.xpos[body]) @ live.data.xmat[body].reshape(3, 3)
                meshes.append(Mesh(inside @ matrix(own.attitudes[name]).T, model.mesh_face[begin : begin + count]))
        bodies[name] = Stack(own.prisms[name].corners, slices_of(join(meshes)))
    return bodies


def share_of_slices(own: EnvironmentSpec, live: LiveModel, bodies: dict[str, Stack]) -> float:
    """Where things stand now; as if all stood on the first of their surfaces, which is the table."""
    spec = own.spec.checked
    poses = np.zeros((1, len(spec.objects), 3))
    for which, name in enumerate(spec.objects):
        if name not in live.movers:
            poses[0, which] = spec.fixed[which]
            continue
        body = live.things[name]
        turn = times(live.data.xquat[body], inverse(own.attitudes[name]))
        poses[0, which] = TableFrame(own.origin).pose(live.data.xpos[body], turn)
    nodes = list(spec.core.nodes)
    for at, node in enumerate(nodes):
        if isinstance(node, Apply) and node.primitive == "visibleShare":
            firsts = (nodes[node.args[one]] for one in (0, *range(BODY + CAMERA, len(node.args), OTHER)))
            names = [spec.core.objects[one.object] if isinstance(one, Coord) else "" for one in firsts]
            shapes = tuple(bodies.get(name, shape) for name, shape in zip(names, node.shapes, strict=True))
            nodes[at] = Apply(node.primitive, node.args, shapes)
    header = make_header(spec, {}, RequestData(phi={}, n=1, spread="flat"))
    on = np.ones((1, len(spec.choices)))
    rows = with_switches(spec, header, wrap_headings(as_rows(poses)), on if spec.choices else None)
    return float(phi(Core(tuple(nodes), spec.core.labels, spec.core.objects), list(rows), NUMPY)["visible"][0])


def measure(task: LiberoTask, shares: list[float], states: int, seed: int) -> Iterator[dict[str, Any]]:
    """The states of a task at each share, with phi of the spec, the share by rays, and that by masks."""
    seer = make_environment(task, seed + 1, pictures=True)
    env = make_environment(task, seed)
    own, live = spec_of(env, sight=True), LiveModel(seer)
    live.model.site_group[:] = UNDRAWN_GROUP  # masks show sites that pictures do not, such as the line under the hand
    bodies = slice_things(own, live)
    for share in shares:
        begun, used = time.time(), time.process_time()
        line: dict[str, Any] = {"suite": task.suite, "task": task.name, "share": share, "n": 0}
        try:
            found = init_states(env, {"visible": (share - HALF, share + HALF)}, states, spec=own, seed=seed)
            line |= {
                "n": len(found.states),
                "drawn": found.drawn,
                "refused": dict(found.refused),
                "masks": [],
                "sliced": [],
            }
            line |= {"phi": found.phi["visible"], "rays": found.read["visible"]}
            for row in found.states:
                seer.set_init_state(row)
                line["masks"].append(min(mask_share(seer, live, name) for name in own.moved))
                line["sliced"].append(share_of_slices(own, live, bodies))
        except RequestError as error:
            line["error"] = str(error).splitlines()[0]
        line |= {key: np.round(line[key], DIGITS).tolist() for key in ("masks", "sliced", "phi", "rays") if key in line}
        yield {**line, "seconds": round(time.time() - begun, 1), "cpu_s": round(time.process_time() - used, 1)}
    env.close()
    seer.close()


def table(lines: list[dict[str, Any]]) -> None:
    """Prints what there is of each share, over all tasks."""
    print("| share | tasks | states / scenes drawn | mask in range | within 5 points of phi | of the rays | CPU s |")
    print("|---|---|---|---|---|---|---|")
    for share in SHARES:
        mine = [one for one in lines if one["share"] == share]
        masks, phi, rays = (
            np.array([value for one in mine for value in one.get(key, [])]) for key in ("masks", "phi", "rays")
        )
        inside, near, seen = np.abs(masks - share) <= HALF + ROUNDING, np.abs(masks - phi) <= 0.05, np.abs(masks - rays)
        full, cpu = sum(one["n"] > 0 for one in mine), np.median([one["cpu_s"] for one in mine])
        cells = [f"{share:.0%}", f"{full} of {len(mine)}", f"{len(masks)} / {sum(one.get('drawn', 0) for one in mine)}"]
        cells += [f"{inside.mean():.0%}", f"{near.mean():.0%}", f"{(seen <= 0.05).mean():.0%}", f"{cpu:.1f}"]
        print(f"| {' | '.join(cells)} |")
    for one in lines:
        if "error" in one or not one["n"]:
            print(one["task"], one["share"], one.get("error") or one["refused"])


def main() -> None:
    reader = argparse.ArgumentParser(description=__doc__)
    reader.add_argument("out", type=Path)
    reader.add_argument("--suite", default="libero_object")
    reader.add_argument("--states", type=int, default=50)
    reader.add_argument("--seed", type=int, default=0)
    reader.add_argument("--only", default="", help="a regular expression for names of tasks")
    reader.add_argument("--table", action="store_true")
    given = reader.parse_args()
    if given.table:
        table([json.loads(line) for line in given.out.read_text().splitlines()])
        return
    done = set()
    if given.out.exists():
        done = {(one["task"], one["share"]) for one in map(json.loads, given.out.read_text().splitlines())}
    for task in tasks_of(given.suite):
        left = [share for share in SHARES if (task.name, share) not in done]
        if left and re.search(given.only, task.name):
            for line in measure(task, left, given.states, given.seed):
                with given.out.open("a") as file:
                    file.write(json.dumps(line) + "\n")


if __name__ == "__main__":
    main()
