"""What `scenegen view` was told to open (a spec, scenes, a model, a folder, or nothing), and the specs of its folder:
listed, read and saved. Nothing outside that folder is touched."""

from __future__ import annotations

import contextlib
import hashlib
import html as markup
import json
import os
import stat
from collections.abc import Collection, Iterable, Iterator
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

from scenegen.api.motions import MotionSet, read_motions
from scenegen.api.reading import read_scenes
from scenegen.api.scene_arrays import SceneArrays, rows_of, stored_rows
from scenegen.api.spec import MAX_SPEC_BYTES, Spec, parse
from scenegen.errors import DataError, RequestError, SpecError
from scenegen.errors.files import DAMAGED_MOTIONS, WRONG_ENDING
from scenegen.errors.program import NOT_OPENED
from scenegen.errors.requests import NO_SCENES
from scenegen.lang.spec import combinations, numbers_text
from scenegen.lang.syntax.parse import read_source
from scenegen.learn.model import is_family, load_model
from scenegen.needs import INSTALL, is_installed
from scenegen.page.jobs.evaluate import scene_set, scenes_json
from scenegen.page.jobs.source import with_numbers
from scenegen.page.limits import MAX_LISTED_SPECS, MAX_TEXT, most_scenes
from scenegen.page.worker import dumps
from scenegen.pose import as_poses, row_count
from scenegen.resources import shipped_specs
from scenegen.sampling.methods import METHODS
from scenegen.scenes.data import SceneFile
from scenegen.scenes.files import is_stream, read_stream, write_whole
from scenegen.scenes.formats.registry import FORMATS, MOTION_FORMATS, is_motions
from scenegen.worlds.exporting import EXPORTS, FORMAT_TITLES, NEEDS

MAX_NAME_BYTES = 255  # bytes of the name of a file or folder
MAX_DRAFTS = 200  # that are kept; the oldest go
MAX_FOLDER_DEPTH = 3  # folders below the opened one that are looked into


class FileRefused(Exception):  # noqa: N818 - the client learns why: no failure
    """What a page wants with a file cannot be done; `status` is that of HTTP."""

    def __init__(self, status: int, reason: str) -> None:
        super().__init__(reason)
        self.status = status


@dataclass(frozen=True, slots=True)
class Folder:
    """`root` is resolved: a path is inside it where it is so with all links followed."""

    root: Path

    def inside(self, path: str) -> Path:
        """The file of a path relative to the folder. Raises FileRefused for any other, and for what is no spec."""
        if not path.isprintable() or not 0 < len(path) <= 1000 or Path(path).is_absolute() or "\\" in path:
            raise FileRefused(400, "name a file of the opened folder by its path in there")
        try:
            found = (self.root / path).resolve()
        except (OSError, RuntimeError, ValueError):
            raise FileRefused(400, "this is no path of a file") from None
        if not found.is_relative_to(self.root):
            raise FileRefused(403, "this file lies outside the folder that was opened")
        if found.suffix.lower() != ".spec":
            raise FileRefused(400, "the page opens and saves files that end in .spec")
        parts = found.relative_to(self.root).parts
        if any(part.startswith(".") for part in parts):
            raise FileRefused(400, "the page opens no hidden files")
        if any(len(os.fsencode(part)) > MAX_NAME_BYTES for part in parts):
            raise FileRefused(400, "this name is too long for a file")
        return found

    def relative(self, path: Path) -> str:
        return path.relative_to(self.root).as_posix()

    def specs(self) -> list[str]:
        """The specs of the folder and of those below it, hidden ones left out."""
        found: list[str] = []
        for at, folders, names in os.walk(self.root):
            here = Path(at)
            deep = len(here.relative_to(self.root).parts)
            folders[:] = sorted(one for one in folders if not one.startswith(".")) if deep < MAX_FOLDER_DEPTH else []
            found += [self.relative(here / name) for name in sorted(names) if name.lower().endswith(".spec")]
            if len(found) >= MAX_LISTED_SPECS:
                break
        return found[:MAX_LISTED_SPECS]

    def read(self, path: str) -> tuple[str, str]:
        """The text of a spec and its hash. Raises FileRefused."""
        return _read(self.inside(path))

    def save(self, path: str, text: str, was: str | None) -> str:
        """Write a spec; returns its hash. `was` is the hash of what the page believes to be there, None for nothing.
        Raises FileRefused, also where something else is there meanwhile."""
        file = self.inside(path)
        data = text.encode()
        if len(data) > MAX_TEXT:
            raise FileRefused(413, f"a spec on the page has at most {MAX_TEXT // 1024} kB")
        if not file.parent.is_dir():
            raise FileRefused(404, "there is no such folder in the opened one")
        there = _read(file)[1] if file.exists() else None  # where the file is gone, nothing is lost
        if there not in (None, was, digest(data)):
            raise FileRefused(409, "the file has changed on the disk since the page read it")
        try:
            write_whole(file, data)
        except OSError as error:
            raise FileRefused(403, f"the file cannot be written: {error.strerror or 'no permission'}") from None
        return digest(data)

    def draft(self, name: str, open_tabs: Collection[str] = ()) -> dict[str, Any] | None:
        """What was written for a file, or for a spec without one, and never saved: its `text`, in `was` the hash of the
        file that it began with, and the `tab` it was written in. Of several the newest; what belongs to a tab that is
        open stays there. None where there is nothing."""
        return next((one for one in _drafts(self._draft_key(name)) if one["tab"] not in open_tabs), None)

    def lost_drafts(self, open_tabs: Collection[str]) -> list[str]:
        """The names of drafts of closed tabs that belong to no file of the folder."""
        kept = [one for one in _drafts() if one["tab"] not in open_tabs and one.get("root") == str(self.root)]
        return sorted({str(one["name"]) for one in kept if not (self.root / str(one["name"])).is_file()})

    def keep_draft(self, name: str, text: str | None, was: str | None, tab: str = "") -> None:
        """Keep what is not saved in a tab, or with None for `text` forget it. Raises FileRefused."""
        if text is not None and len(text.encode()) > MAX_TEXT:
            raise FileRefused(413, f"a spec on the page has at most {MAX_TEXT // 1024} kB")
        file = state_folder() / "drafts" / f"{self._draft_key(name)}{tab and '-'}{tab}.json"
        try:
            if text is None:
                file.unlink(missing_ok=True)
                return
            file.parent.mkdir(mode=0o700, parents=True, exist_ok=True)
            draft = {"text": text, "was": was, "root": str(self.root), "name": name, "tab": tab}
            write_whole(file, json.dumps(draft).encode())
            for old in _newest(file.parent.glob("*.json"))[MAX_DRAFTS:]:
                old.unlink(missing_ok=True)
        except OSError as error:
            raise FileRefused(403, f"what is not saved cannot be kept: {error.strerror or 'no permission'}") from None

    def _draft_key(self, name: str) -> str:
        return digest(os.fsencode(self.root / name))


def state_folder() -> Path:
    """Where drafts and links are kept, for the user alone."""
    return Path(os.environ.get("XDG_STATE_HOME") or Path.home() / ".local/state") / "scenegen"


def _drafts(key: str = "") -> Iterator[dict[str, Any]]:
    """Drafts that can be read, the newest first."""
    for file in _newest((state_folder() / "drafts").glob(f"{key}*.json")):
        with contextlib.suppress(OSError, ValueError, TypeError):
            found = {"tab": "", **json.loads(file.read_bytes())}
            if isinstance(found.get("text"), str):
                yield found


def _newest(files: Iterable[Path]) -> list[Path]:
    return sorted(files, key=lambda one: one.stat().st_mtime, reverse=True)


def digest(data: bytes) -> str:
    return hashlib.sha256(data).hexdigest()


def _read(file: Path) -> tuple[str, str]:
    try:
        # a pipe would hold its reader up for ever, and another file may have taken the place of one that was looked at
        handle = os.open(file, os.O_RDONLY | getattr(os, "O_NONBLOCK", 0))
        try:
            if not stat.S_ISREG(os.fstat(handle).st_mode):
                raise FileRefused(400, "this is no regular file")
            data = _at_most(handle, MAX_TEXT + 1)
        finally:
            os.close(handle)
        if len(data) > MAX_TEXT:
            raise FileRefused(413, f"a spec on the page has at most {MAX_TEXT // 1024} kB")
        return data.decode("utf-8-sig"), digest(data)
    except FileNotFoundError:
        raise FileRefused(404, "there is no such file") from None
    except (OSError, UnicodeDecodeError):
        raise FileRefused(400, "this file cannot be read as text") from None


def _at_most(handle: int, size: int) -> bytes:
    """What can be read, up to a size."""
    parts: list[bytes] = []
    while size and (part := os.read(handle, size)):
        parts.append(part)
        size -= len(part)
    return b"".join(parts)


def shipped_json() -> list[dict[str, str]]:
    """Name, title and text of the specs that ship with scenegen."""
    found = []
    for name, path in shipped_specs().items():
        text = path.read_text(encoding="utf-8")
        head = text.partition("\n")[0]
        found.append({"name": name, "title": head.lstrip("# ").strip() if head.startswith("#") else "", "text": text})
    return found


Part = tuple[dict[str, int], dict[str, Any]]


def stored_scenes(file: Path, together: int = 1) -> tuple[list[Part], Spec, SceneFile]:
    """As many scenes of a file as the page takes, as the job `sample` sends them, with the spec and the head of the
    file. Where the spec draws numbers of things, there is a part for each combination of them, in lexicographic order;
    elsewhere there is one part, with no numbers. So many scenes lie `together`: the start and the goal of a pair.
    Raises DataError, SpecError, and RequestError where there are no scenes."""
    found = read_scenes(file)
    spec = Spec(replace(found.header.spec.checked_spec, name=file.name))
    if not len(found):
        raise RequestError(NO_SCENES(file=file.name))
    parts = list(found.parts())
    most = max(1, most_scenes(len(found.objects)) // len(parts) // together) * together
    names = {tuple(numbers.values()): numbers_text(numbers) for numbers in combinations(spec.definition.counts)}
    scenes: list[Part] = []
    for numbers, which in parts:
        member, numbers = with_numbers(spec, tuple(sorted(numbers.items())))
        some = found.only(numbers, which[:most]) if numbers else found[:most]
        there = f" with {names[tuple(numbers.values())]}" if numbers else ""
        note = f"{len(some):,} of the {len(which):,} scenes{there} of {file.name}"
        cut = [{"code": "", "title": f"the first {note}"}] if len(some) < len(which) else []
        scenes.append((numbers, {**_scenes_json(member, some, note), "together": together, "warnings": cut}))
    return scenes, spec, found.header


def _scenes_json(spec: Spec, scenes: SceneArrays, note: str) -> dict[str, Any]:
    rows = rows_of(spec.checked, scenes)  # in the order of the spec, whatever the file's is
    count = row_count(len(spec.objects))
    on = stored_rows(spec.checked, rows)[count:].T if spec.checked.choices else None
    sampler = scenes.header.sampler
    return scenes_json(spec, scene_set(spec, as_poses(rows[:count]), sampler, on), note)


FIRST_SPEC = "tidy_desk"  # the shipped spec that is shown where nothing was named


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

    def now(self) -> OpenProject:
        """With the text that its file has by now; without a hash where the file is gone."""
        if self.path is None:
            return self
        try:
            text, found = self.folder.read(self.path)
        except FileRefused:
            return replace(self, digest=None)
        return replace(self, text=text, digest=found)

    def data(self) -> dict[str, Any]:
        """What the page gets at first. `shipped` is a name under which commands find this text, `where` the folder as
        seen from the one in which the server was started."""
        example = shipped_specs().get(self.name) if self.path is None else None
        return {
            "text": self.text,
            "name": self.name,
            "path": self.path,
            "sha": self.digest,
            "shipped": self.name if example and example.read_text(encoding="utf-8") == self.text else None,
            "folder": self.folder.root.name or str(self.folder.root),
            "where": os.path.relpath(self.folder.root),
            "model": None if self.model is None else self.model.name,
            "scenes": self.scenes,
            "parts": list(self.parts[:-1]),
            "request": self.request,
            "welcome": self.welcome,
            "methods": methods_data(),
            "formats": formats_data(),
        }


def methods_data() -> list[dict[str, Any]]:
    """The sampling methods that the page offers: whether they draw motions, and whether they need a model."""
    return [{"name": name, "motions": one.over_time, "model": one.proposes} for name, one in METHODS.items()]


FILE_TITLES = {".json": "JSON", ".jsonl": "JSON Lines", ".parquet": "Parquet"}  # what the page calls scene files


def formats_data() -> list[dict[str, Any]]:
    """The formats in which the page gives scenes: of scene files, then of simulators. `motions` says whether motions
    have it, too; `install` is what installs a library that it needs and that is missing, else None."""
    rows: list[tuple[str, str, bool, str | None]] = []
    for ending in FORMATS:
        rows.append((ending[1:], FILE_TITLES.get(ending, ending[1:]), ending in MOTION_FORMATS, None))
    for name in EXPORTS:
        package = NEEDS.get(name)
        install = INSTALL[package] if package and not is_installed(package) else None
        rows.append((name, FORMAT_TITLES.get(name, name), False, install))
    return [dict(zip(("name", "title", "motions", "install"), row, strict=True)) for row in rows]


def open_(what: Path | None) -> OpenProject:
    """Find out what a path or name is, and read it. Raises DataError, RequestError, SpecError."""
    if what is not None and is_stream(what):
        text = read_source("<stdin>", read_stream(what, "a spec", limit=MAX_SPEC_BYTES)).text
        return OpenProject(Folder(Path.cwd().resolve()), text, "stdin")
    if what is not None and is_family(what):
        return _model(what)
    if what is None or what.is_dir():
        folder = Folder((what or Path.cwd()).resolve())
        return OpenProject(folder, shipped_specs()[FIRST_SPEC].read_text(encoding="utf-8"), FIRST_SPEC, welcome=True)
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
    raise DataError(NOT_OPENED(name=str(what), known=shipped))


def _spec(file: Path) -> OpenProject:
    file = file.resolve()
    folder = Folder(file.parent)
    if file.suffix.lower() != ".spec":
        with contextlib.suppress(FileRefused, SpecError):  # what can be read as a spec has the wrong name alone
            parse(_read(file)[0], file.name)
            raise DataError(WRONG_ENDING(path=file.name, ending=".spec", better=f"{file.stem}.spec"))
        reason = "it does not end in .spec, and is no scene file or model"
        raise DataError(NOT_OPENED(file=file, reason=reason, known=shipped_specs()))
    try:
        text, found = folder.read(file.name)
    except FileRefused as reason:
        raise DataError(NOT_OPENED(file=file, reason=str(reason))) from None
    return OpenProject(folder, text, file.stem, file.name, found)


def _scenes(file: Path) -> OpenProject:
    found = read_motions(file) if is_motions(file) else None
    if found is not None and (opened := _motions(file, found)) is not None:
        return opened
    scenes, spec, header = stored_scenes(file, 1 if found is None else found.header.time.steps + 1)
    # the starts of pairs do not lie in the range of their goals
    request = {} if header.request is None or found is not None else header.request.model_dump(mode="json")
    parts = tuple({"counts": numbers, "scenes": some} for numbers, some in scenes)
    numbers, shown = scenes[-1]  # where numbers of things are drawn, the most, as the page begins with
    if numbers:
        request["counts"] = numbers
    return OpenProject(
        Folder(file.resolve().parent), spec.source, file.stem, scenes=shown, parts=parts, request=request
    )


def _motions(file: Path, found: MotionSet) -> OpenProject | None:
    """None for motions of a spec without `time`, such as pairs of a start and a goal: their moments are scenes."""
    from scenegen.page.jobs.motions import most_of, motions_json, motions_of, too_long

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
    note = f"{len(poses):,} of the {len(found):,} motions of {file.name}"
    cut = [{"code": "", "title": f"the first {note}"}] if len(poses) < len(found) else []
    motions = {**motions_json(spec, poses, found.header.sampler, note), "warnings": cut}
    asked = found.header.request.model_dump(mode="json")
    request = {"phi": asked["phi"], "n": min(asked["n"], most)}
    return OpenProject(Folder(file.resolve().parent), text, file.stem, scenes=motions, request=request)


def _model(file: Path) -> OpenProject:
    model = load_model(file)
    text = model.spec.source
    return OpenProject(
        Folder(file.resolve().parent), text, file.stem, model=file.resolve(), digest=digest(text.encode())
    )


STATIC = Path(__file__).resolve().parent / "static"

_PAGE = """<!doctype html>
<html lang="en">
<head>
<meta charset="utf-8">
<meta name="viewport" content="width=device-width, initial-scale=1">
<meta name="color-scheme" content="light dark">
<title>{title}</title>
{head}
</head>
<body>
<div id="app"></div>
<noscript>This page needs JavaScript.</noscript>
<script type="application/json" id="data">{data}</script>
{script}
</body>
</html>
"""


def html(data: dict[str, Any]) -> str:
    """The page as a server sends it; `data` is what it shows first."""
    head = '<link rel="stylesheet" href="/static/page.css">\n<link rel="icon" href="/static/icon.svg">'
    return _fill_page(data, head, '<script type="module" src="/static/page.js"></script>')


def alone(data: dict[str, Any]) -> str:
    """The page as one file that needs no server."""
    css = (STATIC / "page.css").read_text(encoding="utf-8")
    js = (STATIC / "page.js").read_text(encoding="utf-8")
    policy = (
        "default-src 'none'; script-src 'unsafe-inline'; style-src 'unsafe-inline'; img-src data: blob:; "
        "connect-src data: blob:; base-uri 'none'; form-action 'none'"
    )
    head = f'<meta http-equiv="Content-Security-Policy" content="{policy}">\n<style>{css}</style>'
    safe = js.replace("</script", "<\\/script").replace("<!--", "<\\!--")
    return _fill_page(data, head, f'<script type="module">{safe}</script>')


def _fill_page(data: dict[str, Any], head: str, script: str) -> str:
    text = dumps(data).decode().replace("<", "\\u003c").replace("\u2028", "\\u2028").replace("\u2029", "\\u2029")
    title = markup.escape(f"{data.get('name') or 'scenegen'} · scenegen view")
    page = _PAGE.replace("{title}", title).replace("{head}", head).replace("{script}", script)
    return page.replace("{data}", text)
