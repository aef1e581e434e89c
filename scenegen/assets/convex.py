"""Convex pieces of a mesh, by CoACD (Wei et al. 2022, https://colin97.github.io/CoACD/): what it collides with.

CoACD runs in a process of its own: what it makes of a damaged mesh, crashes and endless searches included, ends there.
The seed is fixed, so the same mesh gives the same pieces. They are kept for the next time, by the mesh's content.
"""

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
from functools import lru_cache
from pathlib import Path

import numpy as np

from scenegen.assets.cutting import cut
from scenegen.assets.mesh import Floats, Indices, Mesh
from scenegen.assets.meshfile import MeshError
from scenegen.needs import need
from scenegen.processes.process import GONE, Message, Process
from scenegen.processes.worker import DONE

# Fewer nodes and iterations of its search than the default: a closed bowl takes 7 s, an open box 23 s instead of 100 s.
OPTIONS = {"threshold": 0.05, "max_convex_hull": 64, "mcts_nodes": 10, "mcts_iterations": 40, "seed": 0}
MOST_TRIANGLES = 300_000  # of a mesh that is cut
SECONDS = 300.0  # that cutting one mesh may take
SMALL = 3_000  # triangles up to which it is seen whether a mesh is convex
FLAT = 1e-6  # relative: how far a convex mesh may be from that, and which share of the box a piece must fill
LEAST_PIECE = 1e-6  # of the box round a mesh: what is less is left out


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
    if len(faces) <= SMALL and whole.closed:
        if whole.volume < 0.0:
            whole = Mesh(points, faces[:, ::-1].copy())
        if _is_convex(whole):
            return (whole,)
    if len(faces) > MOST_TRIANGLES:
        raise MeshError(f"it has more than {MOST_TRIANGLES:,} triangles to be cut into convex pieces: simplify it")
    found = _pieces(whole.vertices.tobytes(), whole.faces.astype("<i8").tobytes())
    least, most = points.min(axis=0), points.max(axis=0)
    pieces = []
    for vertices, corners in found:
        piece = Mesh(np.clip(vertices, least, most), corners)  # CoACD's own rounding, and its remeshing, reach outside
        if abs(piece.volume) > LEAST_PIECE * float(np.prod(most - least)):
            pieces.append(piece if piece.volume > 0.0 else Mesh(piece.vertices, corners[:, ::-1].copy()))
    if not pieces:
        raise MeshError("it has no volume")
    return tuple(pieces)


def _is_convex(mesh: Mesh) -> bool:
    a, b, c = (mesh.vertices[mesh.faces[:, corner]] for corner in range(3))
    across = np.cross(b - a, c - a)
    across /= np.maximum(np.linalg.norm(across, axis=1, keepdims=True), 1e-300)
    beyond = mesh.vertices @ across.T - (across * a).sum(axis=1)
    return mesh.volume > 0.0 and bool(beyond.max() <= FLAT * np.ptp(mesh.vertices, axis=0).max())


@lru_cache(maxsize=64)
def _pieces(vertices: bytes, faces: bytes) -> tuple[tuple[Floats, Indices], ...]:
    need("coacd", "to cut meshes into convex pieces")
    name = hashlib.sha256(repr((_version(), OPTIONS, len(vertices))).encode() + vertices + faces).hexdigest()
    path = _folder() / f"{name}.npz"
    kept = _kept(path)
    if kept is None:
        kept = _cut(np.frombuffer(vertices).reshape(-1, 3), np.frombuffer(faces, dtype="<i8").reshape(-1, 3))
        _keep(path, kept)
    return kept


def _version() -> str:
    try:
        return importlib.metadata.version("coacd")
    except importlib.metadata.PackageNotFoundError:
        return "unknown"


def _cut(vertices: Floats, faces: Indices) -> tuple[tuple[Floats, Indices], ...]:
    answers: queue.SimpleQueue[Message] = queue.SimpleQueue()
    cutter = Process("CoACD")
    try:
        cutter.take_up(pickle.dumps(cut, protocol=5), answers, (0, (vertices, faces, OPTIONS)))
        made = answers.get(timeout=SECONDS)
        if made.ready and made.status == DONE:
            made = answers.get(timeout=SECONDS)
    except queue.Empty:
        raise MeshError(f"cutting it into convex pieces takes more than {SECONDS:.0f} s: simplify it") from None
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


def _folder() -> Path:
    """Where pieces are kept between runs."""
    root = os.environ.get("XDG_CACHE_HOME") or "~/.cache"
    return Path(root).expanduser() / "scenegen" / "convex"


def _kept(path: Path) -> tuple[tuple[Floats, Indices], ...] | None:
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


def _keep(path: Path, pieces: tuple[tuple[Floats, Indices], ...]) -> None:
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
