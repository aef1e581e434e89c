"""`scenegen settle`: what physics makes of scenes."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from scenegen.cli import options
from scenegen.cli.many import JobMessages, folder_for, names_of, refuse_engine, shared_work
from scenegen.cli.options import ADDRESS, ENGINE, MESHES_OPTION, POSES_OF, WORKERS, argument, option
from scenegen.cli.output import print_error, progress_bar
from scenegen.errors import RequestError
from scenegen.errors.requests import WRONG_VALUE
from scenegen.scenes.locations import names_set

LENGTHS, ANGLES = ("a length with its unit, such as 2mm", "an angle with its unit, such as 2deg")


def settle(
    sources: list[Path] = argument("A scenes file; several with a folder for --out.", "SCENES"),
    out: str = option(
        "A .json, .jsonl or .parquet file of results; of several, DIR/ for files of the same names.",
        "FILE|DIR/",
        default=...,
    ),
    simulator: str = option("mujoco or pybullet.", "SIMULATOR", flags="--in", default="mujoco"),
    seconds: float = option("Simulated seconds.", "SECONDS", default=2.0, parser=options.seconds),
    max_shift: str = option("How far an object may move.", "LENGTH", default="2mm"),
    max_turn: str = option("By how much an object may turn, about any axis.", "ANGLE", default="2deg"),
    spec: Path | None = POSES_OF,
    meshes: Path | None = MESHES_OPTION,
    workers: int | None = WORKERS,
    engine: str = ENGINE,
    address: str | None = ADDRESS,
) -> int:
    """Let scenes come to rest in a simulator, and write down where their objects are then.

    \b
      scenegen settle scenes.json --out settled.json
      scenegen settle scenes.parquet --in pybullet --out settled.parquet
      scenegen settle scenes.json --max-shift 5mm --max-turn 1deg --out s.jsonl
      scenegen settle sets/*.json --out settled/
      scenegen settle poses.csv --spec my.spec --out settled.json

    The file has for each scene the place and the quaternion of every object, how far it moved (mm) and turned (degrees)
    against the plan, phi of every label at the settled poses, and which objects touched before the simulation, and how
    deep. A scene in which an object moved or turned too far is marked and counted, not left out: the exit status is 0.

    Objects are those of `scenegen export`: convex pieces, mass and friction, on an infinite table. What the spec holds
    in place cannot move. With --meshes, objects of mesh, urdf and asset have the convex pieces, mass and friction of
    their files; without it they are prisms over their outlines. The file appears whole or not at all, and does not
    depend on --workers.

    Several files are settled side by side, by --engine; one that fails is reported by its name, the others are settled,
    and the exit status is 1.
    """
    from scenegen.api.spec import load
    from scenegen.worlds.physics.rest import settle_file

    loaded = None if spec is None else load(spec)
    limits = _quantity("max_shift", max_shift, LENGTHS), _quantity("max_turn", max_turn, ANGLES)
    if len(sources) > 1 or names_set(out):
        from scenegen.scenes.files import ensure_folder

        folder = Path(folder_for(out, len(sources)))
        named = zip(names_of(sources), sources, strict=True)
        jobs = [(name, (source, folder / _result(source))) for name, source in named]
        ensure_folder(folder)
        job = _SettleJob(simulator, seconds, *limits, meshes, spec)
        return shared_work(job, jobs, engine, workers, address, "settling")
    refuse_engine(engine, address)
    with progress_bar() as bar:
        task = bar.add_task("settling", total=None)
        summary = settle_file(
            sources[0], Path(out), simulator, seconds=seconds, max_shift=limits[0], max_turn=limits[1], meshes=meshes,
            workers=workers, spec=loaded,
            progress=lambda done, total: bar.update(task, completed=done, total=total),
        )  # fmt: skip
    print_error(summary.first_line)
    print_error(f"{summary.last_line} in {out}")
    return 0


@dataclass(frozen=True, slots=True)
class _SettleJob:
    """The job of one file among several: (scenes, results)."""

    simulator: str
    seconds: float
    max_shift: float
    max_turn: float
    meshes: Path | None
    spec: Path | None

    def __call__(self, paths: tuple[Path, Path]) -> JobMessages:
        from scenegen.api.spec import load
        from scenegen.worlds.physics.rest import settle_file

        summary = settle_file(
            *paths, self.simulator, seconds=self.seconds, max_shift=self.max_shift, max_turn=self.max_turn,
            meshes=self.meshes, workers=1, spec=None if self.spec is None else load(self.spec),
        )  # fmt: skip
        return JobMessages((f"{summary.last_line} in {paths[1]}",))


def _result(source: Path) -> str:
    """The name of the results of one file among several."""
    from scenegen.scenes.files import ending_of
    from scenegen.scenes.formats.registry import FORMATS

    return source.name if ending_of(source) in FORMATS else f"{source.stem}.json"


def _quantity(name: str, text: str, wanted: str) -> float:
    """A length in metres or an angle in degrees, above 0. Raises RequestError."""
    from scenegen.sampling.request import POSE_UNITS, amount_of

    value = amount_of(text, POSE_UNITS["rad" if wanted is ANGLES else "m"][1:])
    if value is None or not value > 0.0:
        raise RequestError(WRONG_VALUE(argument=name, value=f"`{text}`", wanted=wanted))
    from math import degrees

    return degrees(value) if wanted is ANGLES else value
