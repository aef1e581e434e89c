"""What `scenegen view` was told to open: a spec, scenes, a model, a folder, or nothing."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from scenegen.api.motions import read_motions
from scenegen.api.reading import read_scenes
from scenegen.api.scene_arrays import SceneArrays, rows_of, stored_rows
from scenegen.api.spec import MAX_BYTES, Spec, parse
from scenegen.errors import DataError, RequestError
from scenegen.errors.files import WRONG_ENDING
from scenegen.errors.program import NOT_OPENED
from scenegen.errors.requests import NO_SCENES
from scenegen.errors.time import DAMAGED_MOTIONS
from scenegen.lang.check.families import combinations, written
from scenegen.lang.syntax.parse import read_source
from scenegen.learn.model import is_family, load_model
from scenegen.needs import INSTALL, found
from scenegen.pose import as_poses, row_count
from scenegen.resources import shipped_specs
from scenegen.scenes.data import SceneFile
from scenegen.scenes.files import is_stream, read_stream
from scenegen.scenes.formats.motions.table import is_motions
from scenegen.scenes.formats.registry import FORMATS
from scenegen.show.view.folder import FileRefused, Folder, digest
from scenegen.show.view.jobs.evaluate import scene_set, told
from scenegen.show.view.jobs.source import with_numbers
from scenegen.show.view.limits import most_scenes

# --------------------------------------------------------------------------------------------------------------------
# The scenes of a file as the page shows them.


Part = tuple[dict[str, int], dict[str, Any]]


def stored_scenes(file: Path) -> tuple[list[Part], Spec, SceneFile]:
    """As many scenes of a file as the page takes, as the job `sample` sends them, with the spec and the head of the
    file. Where the spec draws numbers of things, there is a part for each combination of them, in lexicographic order;
    elsewhere there is one part, with no numbers. Raises DataError, SpecError, and RequestError where there are no
    scenes."""
    found = read_scenes(file)
    spec = parse(found.header.spec.source, file.name)
    if not len(found):
        raise RequestError(NO_SCENES(file=file.name))
    parts = list(found.parts())
    most = max(1, most_scenes(len(found.objects)) // len(parts))
    names = {tuple(numbers.values()): written(numbers) for numbers in combinations(spec.declared.counts)}
    scenes: list[Part] = []
    for numbers, which in parts:
        member, numbers = with_numbers(spec, tuple(sorted(numbers.items())))
        some = found.only(numbers, which[:most]) if numbers else found[:most]
        there = f" with {names[tuple(numbers.values())]}" if numbers else ""
        note = f"{len(some):,} of the {len(which):,} scenes{there} of {file.name}"
        scenes.append((numbers, _shown(member, some, note)))
    return scenes, spec, found.header


def _shown(spec: Spec, scenes: SceneArrays, note: str) -> dict[str, Any]:
    rows = rows_of(spec.checked, scenes)  # in the order of the spec, whatever the file's is
    count = row_count(len(spec.objects))
    on = stored_rows(spec.checked, rows)[count:].T if spec.checked.choices else None
    some = scene_set(spec, as_poses(rows[:count]), None, on)
    return {
        **told(spec, some, False),
        "poses": some.poses.tolist(),
        "sampler": scenes.header.sampler,
        "warnings": [],
        "notes": [note],
        "took": 0.0,
    }


STARTER = "first"  # the shipped spec that is shown where nothing was named


@dataclass(frozen=True, slots=True)
class OpenProject:
    """The folder that the page may read and write, and what it shows first. `path` is the spec's in the folder, None
    where it is not saved there; `scenes` are as the job `sample` sends them. `parts` are all scenes of a file by the
    numbers of things in them: of a spec that draws those, `scenes` are the last part. With `welcome` the page begins
    with the examples: nothing was named."""

    folder: Folder
    text: str
    name: str
    path: str | None = None
    digest: str | None = None
    model: Path | None = None
    scenes: dict[str, Any] | None = None
    parts: tuple[dict[str, Any], ...] = ()
    request: dict[str, Any] = field(default_factory=dict)
    welcome: bool = False

    def data(self) -> dict[str, Any]:
        """What the page gets at first; `missing` are formats with what installs them."""
        return {
            "text": self.text,
            "name": self.name,
            "path": self.path,
            "sha": self.digest,
            "folder": self.folder.root.name or str(self.folder.root),
            "model": None if self.model is None else self.model.name,
            "scenes": self.scenes,
            "parts": list(self.parts[:-1]),
            "request": self.request,
            "welcome": self.welcome,
            "missing": {} if found("pxr") else {"usd": INSTALL["pxr"]},
        }


def open_(what: Path | None) -> OpenProject:
    """Find out what a path or name is, and read it. Raises DataError, RequestError, SpecError."""
    if what is not None and is_stream(what):
        text = read_source("<stdin>", read_stream(what, "a spec", limit=MAX_BYTES)).text
        return OpenProject(Folder(Path.cwd().resolve()), text, "stdin")
    if what is not None and is_family(what):
        return _model(what)
    if what is None or what.is_dir():
        folder = Folder((what or Path.cwd()).resolve())
        return OpenProject(folder, shipped_specs()[STARTER].read_text(encoding="utf-8"), STARTER, welcome=True)
    ending = what.suffix.lower()
    if ending == ".safetensors":
        return _model(what)
    if ending in FORMATS:
        return _scenes(what)
    own = next((one for one in (what, what.with_name(f"{what.name}.spec")) if one.is_file()), None)
    if own is not None:
        return _spec(own)
    shipped = shipped_specs()
    if str(what) in shipped:
        return OpenProject(Folder(Path.cwd().resolve()), shipped[str(what)].read_text(encoding="utf-8"), str(what))
    raise DataError(NOT_OPENED(file=what, reason="there is no such file", name=what, known=shipped))


def _spec(file: Path) -> OpenProject:
    file = file.resolve()
    folder = Folder(file.parent)
    if file.suffix.lower() != ".spec":
        raise DataError(WRONG_ENDING(path=file.name, ending=".spec", better=f"{file.stem}.spec"))
    try:
        text, found = folder.read(file.name)
    except FileRefused as reason:
        raise DataError(NOT_OPENED(file=file, reason=str(reason))) from None
    return OpenProject(folder, text, file.stem, file.name, found)


def _scenes(file: Path) -> OpenProject:
    if is_motions(file):
        opened = _motions(file)
        if opened is not None:
            return opened
    scenes, spec, header = stored_scenes(file)
    # the starts of pairs do not lie in the range of their goals
    request = {} if header.request is None or is_motions(file) else header.request.model_dump(mode="json")
    parts = tuple({"counts": numbers, "scenes": some} for numbers, some in scenes)
    numbers, shown = scenes[-1]  # where numbers of things are drawn, the most, as the page begins with
    if numbers:
        request["counts"] = numbers
    return OpenProject(
        Folder(file.resolve().parent), spec.source, file.stem, scenes=shown, parts=parts, request=request
    )


def _motions(file: Path) -> OpenProject | None:
    """None for motions of a spec without `time`, such as pairs of a start and a goal: their moments are scenes."""
    from scenegen.show.view.jobs.motions import motions_of, told
    from scenegen.show.view.jobs.trees import most_of, too_long

    found = read_motions(file)
    text = found.header.spec.source
    spec = parse(text, file.name)
    if spec.horizon is None:
        return None
    most = most_of(spec)
    if most == 0:
        raise DataError(too_long(spec))
    if sorted(found.objects) != sorted(spec.objects) or found.header.time.steps != spec.horizon.steps:
        raise DataError(DAMAGED_MOTIONS(file=file, reason="its motions are not those of its spec"))
    order = [found.objects.index(name) for name in spec.objects]  # in the order of the spec, whatever the file's is
    poses = motions_of(spec, found.poses[:most][:, :, order])
    motions = {
        **told(spec, poses),
        "motions": poses.tolist(),
        "sampler": found.header.sampler,
        "warnings": [],
        "notes": [f"{len(poses):,} of the {len(found):,} motions of {file.name}"],
        "took": 0.0,
    }
    asked = found.header.request.model_dump(mode="json")
    request = {"phi": asked["phi"], "n": min(asked["n"], most)}
    return OpenProject(Folder(file.resolve().parent), text, file.stem, scenes=motions, request=request)


def _model(file: Path) -> OpenProject:
    model = load_model(file)
    text = model.spec.source
    return OpenProject(
        Folder(file.resolve().parent), text, file.stem, model=file.resolve(), digest=digest(text.encode())
    )
