"""What simulators need to know of an object from a file of one's own: convex pieces, mass and friction."""

from __future__ import annotations

import contextlib
import hashlib
import importlib.metadata
import io
import os
import pickle
import queue
import tempfile
import zipfile
from dataclasses import dataclass, field, replace
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np

from scenegen.needs import need
from scenegen.processes.process import DONE, GONE, WorkerMessage, WorkerProcess
from scenegen.scenes.data import SceneFile, ShapeData
from scenegen.scenes.own_files import own_file, read_files
from scenegen.things.colored_mesh import ColoredMesh, check_texture
from scenegen.things.mesh import Mesh, join
from scenegen.things.meshfile import MAX_FRICTION, MAX_MASS, MIN_MASS, Read, mesh_surfaces
from scenegen.things.outline import Floats, Indices, MeshError
from scenegen.things.urdf import (
    Element,
    MeshFiles,
    elements,
    links_of,
    named_error,
    numbers_of,
    origin_of,
    placed_error,
    robot_surfaces,
    sizes_of,
    solid_mesh,
    solid_of,
)

# Convex pieces of a mesh, by CoACD (Wei et al. 2022, https://colin97.github.io/CoACD/): what it collides with.
# CoACD runs in a process of its own: what it makes of a damaged mesh, crashes and endless searches included, ends
# there. The seed is fixed, so the same mesh gives the same pieces. They are kept for the next time, by the mesh's
# content.
# Fewer nodes and iterations of its search than the default: a closed bowl takes 7 s, an open box 23 s instead of 100 s.
COACD_OPTIONS = {"threshold": 0.05, "max_convex_hull": 64, "mcts_nodes": 10, "mcts_iterations": 40, "seed": 0}
MAX_CUT_TRIANGLES = 300_000  # of a mesh that is cut
MAX_CUT_SECONDS = 300.0  # that cutting one mesh may take
MAX_CONVEX_TEST = 3_000  # triangles up to which it is seen whether a mesh is convex
CONVEX_TOLERANCE = 1e-6  # relative: how far a convex mesh may be from that
MIN_PIECE_SHARE = 1e-6  # of the box round a mesh: what is less is left out


def convex_pieces(mesh: Mesh) -> tuple[Mesh, ...]:
    """Convex closed meshes that together fill a mesh, of any number of parts, closed or not; none leaves the box round
    it. A convex mesh is its own piece.

    Raises MeshError where it has no volume or cannot be cut, RequestError where CoACD is needed and not installed.
    """
    used, faces = np.unique(mesh.faces, return_inverse=True)
    # Files have a vertex for each texture and normal that meets in a point.
    points, same = np.unique(mesh.vertices[used], axis=0, return_inverse=True)
    faces = same.ravel()[faces.reshape(-1, 3)]
    faces = faces[(faces[:, 0] != faces[:, 1]) & (faces[:, 1] != faces[:, 2]) & (faces[:, 2] != faces[:, 0])]
    whole = Mesh(points, faces)
    if not len(faces) or not (np.ptp(points, axis=0) > 0.0).all():
        raise MeshError("it has no volume")
    if len(faces) <= MAX_CONVEX_TEST and whole.is_closed:
        if whole.volume < 0.0:
            whole = Mesh(points, faces[:, ::-1].copy())
        if _is_convex(whole):
            return (whole,)
    if len(faces) > MAX_CUT_TRIANGLES:
        raise MeshError(f"it has more than {MAX_CUT_TRIANGLES:,} triangles to be cut into convex pieces: simplify it")
    found = _pieces(whole.vertices.tobytes(), whole.faces.astype("<i8").tobytes())
    least, most = points.min(axis=0), points.max(axis=0)
    pieces = []
    for vertices, corners in found:
        piece = Mesh(np.clip(vertices, least, most), corners)  # CoACD's own rounding, and its remeshing, reach outside
        if abs(piece.volume) > MIN_PIECE_SHARE * float(np.prod(most - least)):
            pieces.append(piece if piece.volume > 0.0 else Mesh(piece.vertices, corners[:, ::-1].copy()))
    if not pieces:
        raise MeshError("it has no volume")
    return tuple(pieces)


def _is_convex(mesh: Mesh) -> bool:
    a, b, c = (mesh.vertices[mesh.faces[:, corner]] for corner in range(3))
    across = np.cross(b - a, c - a)
    across /= np.maximum(np.linalg.norm(across, axis=1, keepdims=True), 1e-300)
    beyond = mesh.vertices @ across.T - (across * a).sum(axis=1)
    return mesh.volume > 0.0 and bool(beyond.max() <= CONVEX_TOLERANCE * np.ptp(mesh.vertices, axis=0).max())


@lru_cache(maxsize=64)
def _pieces(vertices: bytes, faces: bytes) -> tuple[tuple[Floats, Indices], ...]:
    need("coacd", "to cut meshes into convex pieces")
    name = hashlib.sha256(repr((_version(), COACD_OPTIONS, len(vertices))).encode() + vertices + faces).hexdigest()
    path = _folder() / f"{name}.npz"
    kept = _load_pieces(path)
    if kept is None:
        kept = _cut(np.frombuffer(vertices).reshape(-1, 3), np.frombuffer(faces, dtype="<i8").reshape(-1, 3))
        _save_pieces(path, kept)
    return kept


def _version() -> str:
    try:
        return importlib.metadata.version("coacd")
    except importlib.metadata.PackageNotFoundError:
        return "unknown"


def _cut(vertices: Floats, faces: Indices) -> tuple[tuple[Floats, Indices], ...]:
    answers: queue.SimpleQueue[WorkerMessage] = queue.SimpleQueue()
    cutter = WorkerProcess("CoACD", pickle.dumps(cut, protocol=5), answers, (0, (vertices, faces, COACD_OPTIONS)))
    try:
        made = answers.get(timeout=MAX_CUT_SECONDS)
        if made.ready and made.status == DONE:
            made = answers.get(timeout=MAX_CUT_SECONDS)
    except queue.Empty:
        raise MeshError(f"cutting it into convex pieces takes more than {MAX_CUT_SECONDS:.0f} s: simplify it") from None
    finally:
        said = cutter.end()
    if made.status != DONE:
        said = said if made.status == GONE else str(made.value)
        why = "".join(one for one in said if one.isprintable())[:120]
        raise MeshError(f"CoACD cannot cut it into convex pieces{': ' * bool(why)}{why}")
    found: tuple[tuple[Floats, Indices], ...] = tuple(made.value)
    if not found or not all(np.isfinite(one).all() for one, _ in found):
        raise MeshError("CoACD cannot cut it into convex pieces")
    return found


def cut(order: tuple[Floats, Indices, dict[str, Any]]) -> list[tuple[Floats, Indices]]:
    """What a process does that cuts a mesh: vertices (V, 3), faces (F, 3), CoACD's options -> those of the pieces."""
    import coacd

    vertices, faces, options = order
    coacd.set_log_level("off")
    pieces = coacd.run_coacd(coacd.Mesh(vertices, faces.astype(np.int32)), **options)
    return [(np.asarray(v, dtype=np.float64), np.asarray(f, dtype=np.int64)) for v, f in pieces]


def _folder() -> Path:
    """Where pieces are kept between runs."""
    root = os.environ.get("XDG_CACHE_HOME") or "~/.cache"
    return Path(root).expanduser() / "scenegen" / "convex"


def _load_pieces(path: Path) -> tuple[tuple[Floats, Indices], ...] | None:
    """What an earlier run found; None where it did not, or the file is damaged."""
    try:
        with np.load(path, allow_pickle=False) as held:
            points, faces, counts = (held[name] for name in ("vertices", "faces", "counts"))
            ends = np.cumsum(counts, axis=0)[:-1].T
            found = tuple(zip(np.split(points, ends[0]), np.split(faces, ends[1]), strict=True))
    except (OSError, ValueError, KeyError, IndexError, TypeError, EOFError, zipfile.BadZipFile):
        return None
    fits = all(
        v.dtype == np.float64 and f.dtype == np.int64 and v.shape[1:] == f.shape[1:] == (3,) and f.size
        and f.min() >= 0 and f.max() < len(v) and np.isfinite(v).all()
        for v, f in found
    )  # fmt: skip
    return found if fits else None


def _save_pieces(path: Path, pieces: tuple[tuple[Floats, Indices], ...]) -> None:
    """Where it cannot be written, the next run cuts again."""
    data = io.BytesIO()
    counts = np.array([(len(vertices), len(faces)) for vertices, faces in pieces])
    points, faces = (np.concatenate(both) for both in zip(*pieces, strict=True))
    np.savez_compressed(data, vertices=points, faces=faces, counts=counts)
    with contextlib.suppress(OSError, RuntimeError):
        path.parent.mkdir(parents=True, exist_ok=True)
        with tempfile.NamedTemporaryFile(dir=path.parent, delete=False) as file:
            try:
                file.write(data.getvalue())
                file.close()
                Path(file.name).replace(path)
            except BaseException:
                Path(file.name).unlink(missing_ok=True)
                raise


PIECE_SIDES = 24, 24, 8  # sides of a cylinder; of a sphere round and from pole to pole
MAX_OWN_PIECES = 1_000


@dataclass(frozen=True, slots=True, eq=False)
class OwnBody:
    """Convex closed meshes in metres, z upwards, in the file's own frame; kilograms and the coefficient of sliding
    friction, where the file says them. `skins` are drawn, in the same frame: none where they were not asked for."""

    pieces: tuple[Mesh, ...]
    mass: float | None = None
    friction: float | None = None
    skins: tuple[ColoredMesh, ...] = ()

    def shift(self, offset: Floats) -> OwnBody:
        """By an offset (3,) in metres."""
        pieces = tuple(one.shift(*offset.tolist()) for one in self.pieces)
        skins = tuple(replace(one, vertices=one.vertices + offset) for one in self.skins)
        return replace(self, pieces=pieces, skins=skins)

    def turn(self, matrix: Floats) -> OwnBody:
        """Turned and scaled by a matrix (3, 3) that does not mirror; the mass stays."""
        pieces = tuple(Mesh(one.vertices @ matrix.T, one.faces) for one in self.pieces)
        skins = tuple(replace(one, vertices=one.vertices @ matrix.T) for one in self.skins)
        return replace(self, pieces=pieces, skins=skins)


def mesh_body(name: str, data: bytes, read: Read, matrix: Floats | None = None, *, painted: bool = False) -> OwnBody:
    """The body of a .glb, .gltf, .obj or .stl file: convex pieces; no mass or friction, which such files do not have.
    `matrix` (3, 3) turns and scales it, without mirroring, to metres; without it, the file is in metres.
    `read` as in `mesh_surfaces`; `skins` and colours of .obj files are only read if `painted`. Raises MeshError,
    and RequestError as `convex_pieces`."""
    place = np.eye(3) if matrix is None else matrix
    found = mesh_surfaces(name, data, read, painted=painted)
    mesh = join([Mesh(one.vertices, one.faces) for one in found])
    pieces = convex_pieces(mesh if matrix is None else Mesh(mesh.vertices @ place.T, mesh.faces))
    skins = tuple(replace(one, vertices=one.vertices @ place.T) for one in found) if painted else ()
    return OwnBody(pieces, skins=skins)


def robot_body(data: bytes, read: Read, *, painted: bool = False) -> OwnBody:
    """The body of a URDF file in the frame of its root link, all joints at zero: its collision shapes, and the visual
    ones of links that have none; boxes, cylinders and spheres as they are, meshes in convex pieces.

    The mass is the sum of the links' <inertial> masses, none where that is 0. The friction is the largest of those that
    <contact><lateral_friction> and <gazebo><mu1> say. `skins` are the visual shapes, if
    `painted`. `read` gives the bytes of a file by its name in this one.
    Raises MeshError, with line and element, and RequestError as `convex_pieces`.
    """
    robot = elements(data)
    links = links_of(robot)
    reader = _PieceReader(MeshFiles(read, painted=False))
    pieces = [
        Mesh(piece.vertices @ place.turn.T + place.at, piece.faces)
        for link, pose in links
        for shape in link.findall("collision") or link.findall("visual")
        for place in (pose.then(origin_of(shape)),)
        for piece in reader.pieces(solid_of(shape))
    ]
    bare = [link for link, _ in links]
    skins = robot_surfaces(data, read) if painted else ()
    return OwnBody(tuple(pieces), _mass(bare), _friction(robot, bare), skins)


@dataclass(slots=True)
class _PieceReader:
    """The convex pieces of shapes, each in its own frame."""

    files: MeshFiles
    meshes: dict[tuple[str, tuple[float, ...]], tuple[Mesh, ...]] = field(default_factory=dict)
    count: int = 0

    def pieces(self, solid: Element) -> tuple[Mesh, ...]:
        """Raises MeshError, with line and element."""
        found = self._pieces(solid)
        self.count += len(found)
        if self.count > MAX_OWN_PIECES:
            raise MeshError(f"{solid.place}: it has more than {MAX_OWN_PIECES:,} convex pieces")
        return found

    def _pieces(self, solid: Element) -> tuple[Mesh, ...]:
        if solid.tag != "mesh":
            return (solid_mesh(solid, *PIECE_SIDES),)
        key = name, scale = solid.get("filename"), tuple(numbers_of(solid, "scale", 3, "1 1 1"))
        if key not in self.meshes:
            with placed_error(solid):
                mesh = join([Mesh(one.vertices, one.faces) for one in self.files.surfaces(name)])
                faces = mesh.faces[:, ::-1].copy() if float(np.prod(scale)) < 0.0 else mesh.faces
                with named_error(f"mesh {name[:60]}"):
                    self.meshes[key] = convex_pieces(Mesh(mesh.vertices * np.array(scale), faces))
        return self.meshes[key]


def _mass(links: list[Element]) -> float | None:
    total = 0.0
    for link in links:
        for inertial in link.findall("inertial")[:1]:
            (mass,) = sizes_of(inertial.find("mass"), "value", 1)
            total += mass
    if total and not MIN_MASS <= total <= MAX_MASS:
        raise MeshError(f"its mass of {total:g} kg is beyond {MIN_MASS:g} to {MAX_MASS:g} kg")
    return total or None


def _friction(robot: Element, links: list[Element]) -> float | None:
    said = [
        sizes_of(one, "value", 1)[0]
        for link in links
        for contact in link.findall("contact")
        for one in contact.findall("lateral_friction")
    ]
    for gazebo in robot.findall("gazebo"):
        for one in gazebo.findall("mu1"):
            # Both <mu1>0.8</mu1> and <mu1 value="0.8"/> are written.
            given = one if "value" in one.attributes else Element(one.tag, {"value": one.text.strip()}, one.line)
            said += sizes_of(given, "value", 1)
    if any(one > MAX_FRICTION for one in said):
        raise MeshError(f"its friction of {max(said):g} is beyond {MAX_FRICTION:g}")
    return max(said) if said else None


def own_bodies_of(file: SceneFile, folder: Path, *, painted: bool = False) -> dict[str, OwnBody]:
    """By the objects' names, in the objects' frames (z = 0 the lowest point of the outline): the bodies of those whose
    shape is `mesh` or `asset` of a glTF, .obj, .stl or URDF file, or `urdf`. `folder` is where the spec lay; a file
    outside it is not read. With `painted`, they have what is drawn, with colours and textures, too. Objects from other
    mesh files have none, and collide as their outline.

    Raises DataError where a file cannot be read or cut into convex pieces, where it has another outline than the scenes
    were made with, and where no object has such a file, RequestError where CoACD is needed and not installed.
    """
    bodies = read_files(file, folder, lambda shape: _own_body(folder, shape, painted), body=True)
    return {item.name: body for item, body in zip(file.objects, bodies, strict=True) if body is not None}


def _own_body(folder: Path, shape: ShapeData, painted: bool) -> OwnBody:
    file = own_file(folder, shape)
    if file.is_robot:
        made = robot_body(file.data, file.beside, painted=painted).turn(file.matrix)
    else:
        made = mesh_body(file.path, file.data, file.beside, file.matrix, painted=painted)
    for texture in {one.texture for one in made.skins if one.texture} if painted else ():
        check_texture(texture, "a texture of it")
    mass = made.mass if file.mass is None else file.mass
    friction = made.friction if file.friction is None else file.friction
    return replace(made, mass=mass, friction=friction).shift(file.offset)
