"""Sets of scenes: arrays in memory, scene files on disk."""

from __future__ import annotations

import contextlib
import math
import reprlib
from collections.abc import Callable, Iterator, Mapping
from dataclasses import InitVar, dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any, overload

import numpy as np
import numpy.typing as npt

from scenegen.api.scene_arrays import SceneArrays, header_of, parts_of, stored_rows
from scenegen.arrays import Array, plain_values
from scenegen.errors import DataError, Diagnostic, RequestError
from scenegen.errors.files import PHI_DIFFERS
from scenegen.errors.requests import NO_SCENES, NOT_AN_INDEX, NOT_INSTALLED, WRONG_VALUE
from scenegen.geometry import NUMPY, Circle
from scenegen.geometry.workspace import wrap_headings
from scenegen.lang.formula.core import REQUIRE, Atom, gate
from scenegen.lang.formula.interpret import deciding_atom
from scenegen.lang.formula.interpret import evaluate as interpret
from scenegen.lang.formula.interpret import phi as score
from scenegen.lang.spec import CheckedSpec
from scenegen.pose import THETA, TWO_PI, X, as_poses, row_count
from scenegen.scenes.blocks import COUNT_PREFIX, Block, columns, element
from scenegen.scenes.data import Pose, SceneData, SceneFile
from scenegen.scenes.formats.jsonl import block_of
from scenegen.validation import as_path

if TYPE_CHECKING:
    import pandas

    from scenegen.pictures.render.scenes import Rendered
    from scenegen.sampling.problem import Problem


@dataclass(frozen=True, slots=True)
class Scene:
    """`poses` maps each object to where it stands (x and y in metres, theta in radians), `phi` each label to its value;
    `header` is the scene file it is of, without scenes; `rest` (N, 7) is as of a SceneSet. Two scenes are equal if
    poses and phi are."""

    poses: Mapping[str, Pose]
    phi: Mapping[str, float]
    header: SceneFile = field(repr=False, compare=False)
    rest: npt.NDArray[np.float64] | None = field(default=None, repr=False, compare=False)

    def __repr__(self) -> str:
        places = (
            f"{name} ({pose.x:.3f}, {pose.y:.3f}, {math.degrees(pose.theta):.0f} deg)"
            for name, pose in self.poses.items()
        )
        phi = (f"{label} {value:.3g}" for label, value in self.phi.items())
        return f"<Scene: {', '.join(places)}; phi {', '.join(phi)}>"

    def data(self) -> SceneData:
        """The scene as files hold it."""
        return SceneData(poses=dict(self.poses), phi=dict(self.phi), counts=self.counts or None)

    @property
    def counts(self) -> dict[str, int]:
        """How many things there are, by array of objects, where that is drawn; of an object of a category the number of
        its asset, from 1."""
        found: dict[str, int] = {}
        for one in self.header.counts:
            here = [k for k in range(1, one.most + 1) if element(one, k) in self.poses]
            found[one.name] = here[0] if one.assets else len(here)
        return found

    def file(self) -> SceneFile:
        """A scene file with this scene alone."""
        return self.header.model_copy(update={"scenes": [self.data()]})

    def _repr_png_(self) -> bytes | None:
        """For notebooks: the scene in perspective."""
        from scenegen.pictures.notebook import picture

        return picture(self.file(), self.rest)


Picked = slice | npt.NDArray[np.bool_] | npt.NDArray[np.integer] | list[int]

PHI_TOLERANCE = 1e-9  # how far stored and computed phi may lie apart
CACHED_SCENES = 32_768  # scenes scored at a time, so that they stay in cache


@dataclass(frozen=True, slots=True, eq=False)
class SceneSet(SceneArrays):
    """Scenes of one spec: `poses` (n, N, 3), `phi` by label, `header`, `warnings`, `on`, `rest`; see SceneArrays.

    A number picks a scene, and a slice, a mask or an array of numbers a smaller set. Notebooks show the first scenes as
    pictures. Neither poses nor phi can be written to, and phi is what the header's spec gives: DataError is raised for
    other values. `Spec.scenes` makes a set of poses alone.
    """

    trusted: InitVar[bool] = False  # phi was computed here, or a reader of files is to compare it
    _drawn: list[bytes | None] = field(default_factory=list, init=False, repr=False)  # the sheet, once it is drawn

    def __post_init__(self, trusted: bool) -> None:
        object.__setattr__(self, "phi", {name: _still(values) for name, values in self.phi.items()})
        for name in ("poses", "on", "rest"):
            if getattr(self, name) is not None:
                object.__setattr__(self, name, _still(getattr(self, name)))
        if self.phi and not trusted:
            _check_phi(self)

    def __repr__(self) -> str:
        spans = [
            f"{name} {values.min():.3g}..{values.max():.3g}" if len(values) else name
            for name, values in self.phi.items()
        ]
        return f"<SceneSet: {len(self)} scenes of {self.names()}; phi {', '.join(spans)}>"

    @overload
    def __getitem__(self, index: int) -> Scene: ...
    @overload
    def __getitem__(self, index: Picked) -> SceneSet: ...
    def __getitem__(self, index: int | Picked) -> Scene | SceneSet:
        given: Any = index
        index = given.item() if getattr(given, "shape", None) == () else index  # a number of numpy or torch
        if isinstance(index, bool) or not isinstance(index, int):
            index = _as_index(index, len(self))
            phi = {name: values[index] for name, values in self.phi.items()}
            on = None if self.on is None else self.on[index]
            rest = None if self.rest is None else self.rest[index]
            return SceneSet(self.poses[index], phi, self.header, on=on, rest=rest, trusted=True)
        return Scene(*self.places(index), self.header, None if self.rest is None else self.rest[index])

    def __iter__(self) -> Iterator[Scene]:
        return (self[index] for index in range(len(self)))

    def mirrored(self) -> SceneSet:
        """Each scene as in a mirror: x counted from the other side of the workspace, headings turned with it, and phi
        as the spec gives it there. Raises DataError where the spec holds an object off the middle."""
        self.refuse_rest("mirrored")
        spec, (left, right) = self.header.spec.checked_spec, self.header.workspace.x
        poses = self.poses.copy()
        poses[..., X] = left + right - poses[..., X]
        poses[..., THETA] = np.remainder(math.pi - poses[..., THETA], TWO_PI)
        for index, pose in spec.fixed.items():  # a round thing in the middle is its own mirror image
            column = self.objects.index(spec.objects[index])
            there = np.allclose(poses[:, column, X], pose[X], atol=1e-9)
            if there and isinstance(spec.shapes[index].footprint, Circle):
                poses[:, column] = pose
        header = self.header.model_copy(update={"sampler": {**self.header.sampler, "mirrored": True}})
        bare = SceneSet(poses, {}, header, on=self.on)
        return SceneSet(poses, evaluate(spec, bare), header, self.warnings, on=self.on, trusted=True)

    def to_pandas(self) -> pandas.DataFrame:
        """A data frame with one row per scene and the columns of a Parquet file: `mug.x`, ..., `phi.task`.

        Raises RequestError where pandas is not installed, OutputError where two columns would share a name.
        """
        try:
            import pandas
        except ModuleNotFoundError as error:
            known = {"package": "pandas", "purpose": "for data frames", "command": "pip install pandas"}
            raise RequestError(NOT_INSTALLED(**known)) from error
        names = columns(self.header, tuple(self.phi))
        poses, phi = self.to_numpy()
        on = [] if self.on is None else [self.on]
        counts = self.counts
        each = [number[:, None].astype(np.float64) for number in counts.values()]
        table = np.concatenate([poses.reshape(len(self), row_count(len(self.objects))), *on, *each, phi], axis=1)
        return pandas.DataFrame(table, columns=names).astype({f"{COUNT_PREFIX}{name}": np.int64 for name in counts})

    def _sheet(self) -> bytes | None:
        """The contact sheet of the first scenes, drawn when a notebook first shows it."""
        if not self._drawn:
            from scenegen.pictures import notebook

            some = self[: notebook.NOTEBOOK_SCENES]
            self._drawn.append(notebook.sheet(some.file(), some.rest))
        return self._drawn[0]

    def _repr_html_(self) -> str:
        """For notebooks. The picture is part of the page: a `_repr_png_` beside it would be stored a second time."""
        from scenegen.pictures.notebook import page

        return page(self, self._sheet)

    def export(
        self,
        out: str | Path,
        to: str | None = None,
        *,
        meshes: str | Path | None = None,
        looks: str | Path | None = None,
        seed: int = 0,
    ) -> tuple[Path, ...]:
        """Write the scenes for a simulator: `to` is "mjcf" (MuJoCo), "sdf" (Gazebo) or "usd" (Isaac Sim; it needs
        usd-core); for planners: "pddl" (see `export_problems`); or in a format of scene files.

        A file with the ending .xml, .sdf, .world, .usd, .usda or .usdc holds all scenes, as keyframes, as worlds or as
        variants; any other `out` is a folder with a file for each, in scene order. Meshes lie beside the files, which
        name them relatively. With `meshes`, the folder that the spec was in, objects with a mesh or URDF file have
        convex pieces, mass and friction from it, instead of a prism over their outline. With `looks`, "random" or a
        TOML file, every scene of a folder for "mjcf" or "usd" has the table, surroundings, light, colours and camera of
        its picture by `render` with the same `looks` and `seed`; looks.jsonl says what they are. Returns the paths of
        the scenes' files. Raises RequestError, DataError, OutputError.
        """
        from scenegen.worlds import exporting

        folder = None if meshes is None else as_path("meshes", meshes)
        return exporting.export(self, as_path("out", out), to, folder, looks, seed)

    def render(
        self,
        out: str | Path,
        *,
        views: tuple[str, ...] | None = None,
        camera: str | None = None,
        size: tuple[int, int] | None = None,
        distinct: bool = False,
        transparent: bool = False,
        depth: bool = False,
        masks: bool = False,
        renderer: str = "software",
        looks: str | Path | None = None,
        seed: int = 0,
        meshes: str | Path | None = None,
        workers: int | None = None,
        progress: Callable[[int, int], None] | None = None,
    ) -> Rendered:
        """Draw every scene from every view into the folder `out`, and a contact sheet of all.

        `camera` names a camera that the spec declares, which is then the one view.
        `views` are of "top", "perspective", "front" and "three-quarter", by default the first two. `size` is in pixels,
        by default (640, 480), wider for a wide workspace. `distinct` colours objects apart that would look the same.
        `transparent` leaves out the ground below the table; `depth` and `masks` add the depth in metres and what each
        pixel shows, as PNG and NPZ. `looks`, a TOML file or "random", draws a look for each scene by `seed`; the
        default view is then "look", from the look's own camera, and looks.jsonl records what was drawn. `meshes`,
        the folder that the spec was in, draws objects with a mesh or URDF file as their files show them. The result's
        `pictures` are the paths in scene order, `sheet` is the contact sheet's, `cameras` that of a JSON file with
        intrinsics, extrinsics and the numbers in masks. Needs no display and no GPU. `progress` is called with the
        number of scenes drawn and their total. Raises RequestError, DataError, OutputError.
        """
        from scenegen.pictures.render.scenes import render_scenes

        return render_scenes(
            self.file(),
            as_path("out", out),
            views=views,
            camera=camera,
            size=size,
            distinct=distinct,
            transparent=transparent,
            depth=depth,
            masks=masks,
            renderer=renderer,
            looks=looks,
            seed=seed,
            meshes=None if meshes is None else as_path("meshes", meshes),
            workers=workers,
            progress=progress,
            rest=self.rest,
        )

    def figures(
        self,
        out: str | Path,
        *kinds: str,
        view: str = "perspective",
        size: tuple[int, int] | None = None,
        distinct: bool = False,
        label: str | None = None,
        workers: int | None = None,
    ) -> tuple[Path, ...]:
        """Make figures in the folder `out`: "sheet", "sweep", "gif", "heatmap", "topview"; see `scenegen render
        --help`. Returns the paths of their files. Raises RequestError, DataError, OutputError."""
        from scenegen.pictures.scenes import figures

        return figures(self, out, kinds, view=view, size=size, distinct=distinct, label=label, workers=workers)


def _still(values: Array) -> Array:
    """The same numbers, not to be written to: phi beside them would be that of others."""
    view = (values if type(values) is np.ndarray else np.asarray(plain_values(values))).view()
    view.flags.writeable = False
    return view


def _check_phi(scenes: SceneSet) -> None:
    """Raises RequestError for arrays of other shapes, DataError for phi that the header's spec does not give."""
    shape = (len(scenes.poses), len(scenes.objects), 3)
    if np.shape(scenes.poses) != shape or any(np.shape(one) != shape[:1] for one in scenes.phi.values()):
        value, wanted = f"of the shape {np.shape(scenes.poses)}", f"{shape}, and phi ({shape[0]},) of each label"
        raise RequestError(WRONG_VALUE(argument="poses", value=value, wanted=wanted))
    for wrong in compare(scenes.header.spec.checked_spec, scenes, "the set"):
        raise DataError(wrong)


def compare(spec: CheckedSpec, scenes: SceneSet, name: str | Path) -> Iterator[Diagnostic]:
    """What is wrong with phi of the scenes of a file called `name`, if anything is."""
    phi = evaluate(spec, scenes)
    for label in sorted(scenes.phi.keys() - phi.keys()):
        yield PHI_DIFFERS(file=name, label=label, unknown=True)
    for label, values in phi.items():
        if label not in scenes.phi:
            yield PHI_DIFFERS(file=name, label=label)
            continue
        off = ~(np.abs(values - scenes.phi[label]) <= PHI_TOLERANCE)  # NaN is off, too
        if off.any():
            worst = int(np.nan_to_num(np.abs(values - scenes.phi[label]), nan=np.inf).argmax())
            facts = {"scene": worst + 1, "file": name, "label": label, "count": int(off.sum())}
            yield PHI_DIFFERS(**facts, stored=scenes.phi[label][worst], computed=values[worst])


def _as_index(index: object, count: int) -> Picked:
    """What picks some of `count` scenes, once it is a thing that does: numpy makes something else of None, of tuples
    and of lists of lists. Raises RequestError, also for a mask of another length."""
    holes: list[bool] = []
    with contextlib.suppress(TypeError, ValueError):  # slices of words, ragged lists
        if isinstance(index, slice):
            range(count)[index]
            return index
        if isinstance(index, list) or hasattr(index, "__array__"):  # of numpy, torch and pandas
            chosen = np.asarray(index)
            chosen = chosen if chosen.size else np.empty(0, dtype=np.intp)  # [] would be one of floats
            mask = chosen.dtype == np.bool_ and len(chosen) == count
            if chosen.ndim == 1 and (mask or np.issubdtype(chosen.dtype, np.integer)):
                return chosen
            holes = [str(one) in ("None", "<NA>", "nan") for one in chosen.tolist()] if len(chosen) == count else []
    if any(holes):
        raise RequestError(NOT_AN_INDEX(value=f"a mask without a value at {holes.index(True)}", count=count, hole=True))
    raise RequestError(NOT_AN_INDEX(value=" ".join(reprlib.repr(index).split()), count=count))


def from_file(file: SceneFile) -> SceneSet:
    """The arrays of a scene file."""
    labels = file.label_names
    return scene_set(file.without_scenes(), labels, block_of(file.scenes, file, labels))


def scene_set(header: SceneFile, labels: tuple[str, ...], scenes: Block) -> SceneSet:
    placed = scenes.rows[: row_count(len(header.objects))]
    poses = np.ascontiguousarray(as_poses(wrap_headings(placed)))
    on = np.ascontiguousarray(scenes.rows[len(placed) :].T) if header.choosers else None
    return SceneSet(poses, dict(zip(labels, scenes.phi, strict=True)), header, on=on, trusted=True)


def scenes_of(
    problem: Problem, sampler: Mapping[str, object], rows: Array, phi: Array, warnings: tuple[Diagnostic, ...] = ()
) -> SceneSet:
    """Rows of a problem's core (3N + ..., n), with phi of at least its spec's labels, as a set of scenes."""
    spec = problem.spec
    placed = rows[: row_count(len(spec.objects))]  # poses are a view of it, in which each coordinate is contiguous
    on = stored_rows(spec, rows)[len(placed) :].T if spec.choices else None
    by_label = dict(zip(spec.labels, phi, strict=False))
    return SceneSet(as_poses(placed), by_label, header_of(problem, sampler), warnings, on=on, trusted=True)


def evaluate(spec: CheckedSpec, scenes: SceneSet) -> dict[str, Array]:
    """phi of every label for given scenes, (n,) each, by the exact spec. Raises DataError for other objects."""
    phi = {name: np.empty(len(scenes)) for name in spec.labels}
    for part in parts_of(spec, scenes):
        for start in range(0, len(part.which), CACHED_SCENES):
            some = slice(start, start + CACHED_SCENES)
            rows = list(np.ascontiguousarray(part.rows[:, some]))
            for name, value in score(part.spec.core, rows, NUMPY).items():
                phi[name][part.which[some]] = value
    return phi


def requirement(spec: CheckedSpec, scenes: SceneSet) -> Array | None:
    """The margin by which each scene meets what the spec requires, (n,): negative where it does not. None where the
    spec requires nothing; infinite in scenes of which it requires nothing because they have too few things."""
    if all(one.core.requirement is None for one in spec.members or (spec,)):
        return None
    margin = np.full(len(scenes), np.inf)
    for part in parts_of(spec, scenes):
        if part.spec.core.requirement is not None:
            margin[part.which] = score(gate(part.spec.core), list(part.rows), NUMPY)[REQUIRE]
    return margin


def explain(spec: CheckedSpec, scenes: SceneSet) -> dict[str, list[str]]:
    """For every label and scene the atom that decides phi: its margin is phi, so it alone would have to change. Where a
    margin that is the same in every scene is phi, it is the atom that decides without that one."""
    atoms: dict[str, list[str]] = {label: [""] * len(scenes) for label in spec.labels}
    for part in parts_of(spec, scenes):
        core = part.spec.core
        for which, scene in zip(part.which, part.rows.T, strict=True):
            values = interpret(core, scene.tolist())
            for label, found in atoms.items():
                atom = core.nodes[deciding_atom(core, label, values)]
                assert isinstance(atom, Atom)
                found[which] = atom.text
    return atoms


def check_count(scenes: SceneSet) -> None:
    """Refuse an empty set where there is nothing to do with it. Raises RequestError."""
    if not len(scenes):
        raise RequestError(NO_SCENES())
