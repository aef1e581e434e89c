"""Tags in a photograph, and the camera that took it: from the tags of the mat, whose places are known.

A camera that nobody has calibrated is fitted with the mat: its focal length, the bend k1 of its lens, and its middle,
which stay near what cameras have where the tags do not tell (Levenberg 1944, Marquardt 1963, with them as further
residuals).
"""

from __future__ import annotations

import json
import math
import os
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, replace
from itertools import pairwise
from operator import itemgetter
from pathlib import Path
from typing import Self

import numpy as np
import numpy.typing as npt

from scenegen.arrays import Array
from scenegen.errors import DataError
from scenegen.errors.worlds import STAGE_MAT, STAGE_PHOTO
from scenegen.needs import need
from scenegen.play.stage.stage import MAT_TAGS, TAG_CELLS, TableStage, square_corners
from scenegen.play.suites.suite import GradedStart
from scenegen.scenes.files import read_bytes

Grey = npt.NDArray[np.uint8]
FOCAL, FOCAL_SPREAD = 0.8, 0.25  # of the longer side; standard deviation of its logarithm
EXIF_SPREAD = 0.03  # where the photograph says it
BEND_SPREAD = 0.1  # of k1
MIDDLE_SPREAD = 0.006  # of the longer side: how far the principal point is from the middle
POSE_PARAMETERS, LENS_PARAMETERS, TAG_PARAMETERS = 6, 4, 3  # of a camera its place and lens, of a tag its place
PIXEL_ERROR = 0.2  # standard deviation of a corner of a tag, pixels
MOST_OFF = 0.0015  # metres: what corners of the mat's tags may be off; a thousandth of the mat, or a pixel, if more
OTHER_SIZE = 0.01  # relative: a mat of another size
SMALL_PICTURE = 2600  # pixels: where tags are looked for at twice the size, too
FIT_STEPS, TRIED_STARTS = 60, 2
SLOPE_STEP = 1e-6  # relative, of differences
EDGE_REACH = 0.6 / TAG_CELLS  # of a tag's side: how far on both sides of an edge brightness is looked at
EDGE_ROUNDS, EDGE_STEPS, EDGE_POINTS, EDGE_SHARE = 2, 17, 24, 0.12  # of lines along the edges of a tag
FOCAL_STARTS = (0.6, 0.9, 1.4, 2.5)  # of the longer side
EXIF, EXIF_FOCAL = 0x8769, 0xA405  # tags of EXIF: its part for cameras, and the focal length of film of 43.3 mm
FILM_DIAGONAL = math.hypot(36.0, 24.0)


@dataclass(frozen=True, slots=True, eq=False)
class Photograph:
    """A picture (h, w) or (h, w, 3), the corners (4, 2) of tags by their ids in pixels, and the focal length in pixels
    if the file says it."""

    name: str
    picture: Grey
    tags: Mapping[int, Array]
    focal: float | None = None

    @staticmethod
    def read(path: Path) -> Photograph:
        """Raises DataError for what is no picture, RequestError without OpenCV."""
        import io

        from PIL import Image, ImageOps, UnidentifiedImageError

        data = read_bytes(path, "a photograph")
        try:
            picture = ImageOps.exif_transpose(Image.open(io.BytesIO(data)))
            film = picture.getexif().get_ifd(EXIF).get(EXIF_FOCAL)
            colors = np.asarray(picture.convert("RGB"))
        except UnidentifiedImageError:  # whose text is the place of the bytes in memory
            raise DataError(STAGE_PHOTO(file=path, reason="no format of pictures begins like that")) from None
        except (OSError, ValueError, Image.DecompressionBombError) as error:
            raise DataError(STAGE_PHOTO(file=path, reason=str(error) or type(error).__name__)) from None
        focal = float(film) / FILM_DIAGONAL * math.hypot(*picture.size) if film else None
        return Photograph.from_picture(colors, str(path), focal)

    @staticmethod
    def from_picture(picture: Grey, name: str, focal: float | None = None) -> Photograph:
        """A picture of a camera, (h, w) or (h, w, 3)."""
        need("cv2", "for tags")
        import cv2

        grey = picture if picture.ndim == 2 else cv2.cvtColor(picture, cv2.COLOR_RGB2GRAY)
        settings = cv2.aruco.DetectorParameters()
        settings.cornerRefinementMethod = cv2.aruco.CORNER_REFINE_SUBPIX
        settings.minMarkerPerimeterRate = 0.01
        family = cv2.aruco.getPredefinedDictionary(cv2.aruco.DICT_APRILTAG_36h11)
        detector = cv2.aruco.ArucoDetector(family, settings)
        corners, ids, _ = detector.detectMarkers(grey)
        found = {} if ids is None else {int(tag): one[0] for tag, one in zip(ids.ravel(), corners, strict=True)}
        if max(grey.shape) < SMALL_PICTURE:  # tags of some 20 pixels, which are too small as they are
            corners, ids, _ = detector.detectMarkers(cv2.resize(grey, None, fx=2, fy=2, interpolation=cv2.INTER_CUBIC))
            twice = zip([] if ids is None else ids.ravel().tolist(), corners, strict=True)
            found = {tag: one[0] / 2.0 - 0.25 for tag, one in twice} | found
        tags = {tag: refine_corners(grey, np.asarray(one, dtype=float)) for tag, one in found.items()}
        return Photograph(name, picture, tags, focal)


def read_frames(source: str) -> Iterator[Grey]:
    """Pictures (h, w, 3) of a source of OpenCV: the number of a camera, a file, or a URL. Raises DataError where there
    are none."""
    need("cv2", "for cameras")
    os.environ.setdefault("OPENCV_FFMPEG_LOGLEVEL", "-8")
    import cv2

    before = cv2.utils.logging.setLogLevel(cv2.utils.logging.LOG_LEVEL_SILENT)
    video = cv2.VideoCapture(int(source) if source.isdecimal() else source)
    try:
        video.set(cv2.CAP_PROP_BUFFERSIZE, 1)
        read, frame = video.read()
        if not read:
            raise DataError(STAGE_PHOTO(source=source))
        while read:
            yield np.asarray(frame)[..., ::-1].copy()
            read, frame = video.read()
    finally:
        video.release()
        cv2.utils.logging.setLogLevel(before)


def refine_corners(grey: Grey, corners: Array) -> Array:
    """Corners (4, 2) of a tag where the lines along its four edges meet: an edge is where brightness grows most across
    it, on the average over a cell. Blur does not move edges, but it rounds corners off, and makes small tags
    smaller."""
    import cv2

    for _ in range(EDGE_ROUNDS):
        lines = []
        for one, other in pairwise((*corners, corners[0])):
            length = math.dist(one, other)
            along = (other - one) / length
            across = np.array([along[1], -along[0]])  # outwards: corners run clockwise in pixels
            steps = np.linspace(-EDGE_REACH * length, EDGE_REACH * length, EDGE_STEPS)
            shares = np.linspace(EDGE_SHARE, 1.0 - EDGE_SHARE, EDGE_POINTS) * length
            places = (one + shares[:, None] * along)[:, None] + steps[:, None] * across
            u, v = places.astype(np.float32).transpose(2, 0, 1)
            slopes = np.diff(cv2.remap(grey, u, v, cv2.INTER_LINEAR).astype(float), axis=1).clip(min=0.0)
            weights = slopes.sum(axis=1)
            offs = slopes @ ((steps[1:] + steps[:-1]) / 2.0) / np.maximum(weights, 1e-9)
            slope, off = np.polyfit(shares, offs, 1, w=np.sqrt(weights) + 1e-9)
            lines.append((one + off * across, along + slope * across))
        try:
            corners = np.array([_meet(lines[k - 1], lines[k]) for k in range(4)])
        except np.linalg.LinAlgError:  # of a few pixels
            break
    return corners


def _meet(line: tuple[Array, Array], other: tuple[Array, Array]) -> Array:
    """Where two lines meet, each a point and a direction."""
    share, _ = np.linalg.solve(np.column_stack([line[1], -other[1]]), other[0] - line[0])
    return np.asarray(line[0] + share * line[1])


@dataclass(frozen=True, slots=True, eq=False)
class StageCamera:
    """Matrix (3, 3) and distortion (5,) as OpenCV has them; `turn` (3, 3) and `shift` (3,) lead from the frame of the
    mat to that of the camera. `doubts` are cameras a standard deviation off, each in an independent way."""

    matrix: Array
    distortion: Array
    turn: Array
    shift: Array
    doubts: tuple[StageCamera, ...] = ()

    def project(self, points: Array) -> Array:
        """Pixels (P, 2) of points (P, 3)."""
        import cv2

        turn, _ = cv2.Rodrigues(self.turn)
        return np.asarray(cv2.projectPoints(points, turn, self.shift, self.matrix, self.distortion)[0]).reshape(-1, 2)

    def place(self, pixels: Array, height: float) -> Array:
        """(P, 2): x and y of what is seen at pixels (P, 2), at a height in metres above the mat."""
        import cv2

        plain = cv2.undistortPoints(pixels.reshape(-1, 1, 2), self.matrix, self.distortion).reshape(-1, 2)
        rays = np.column_stack([plain, np.ones(len(plain))]) @ self.turn
        eye = -self.turn.T @ self.shift
        return np.asarray(eye[:2] + rays[:, :2] * ((height - eye[2]) / rays[:, 2:]))

    def place_error(self, pixels: Array, height: float) -> float:
        """How far off such places are, in metres: the standard deviation that the doubts make."""
        place = self.place(pixels, height)
        off = [one.place(pixels, height) - place for one in self.doubts]
        return math.sqrt(float(np.square(off).sum(axis=(0, 2)).max())) if off else 0.0


@dataclass(frozen=True, slots=True)
class Lens:
    """What is known of a camera before: `matrix` (3, 3) and `distortion` (5,)."""

    matrix: Array
    distortion: Array

    @classmethod
    def read(cls, path: Path) -> Self:
        """A file {"matrix": [[...], ...], "distortion": [...]}, as OpenCV calibrates. Raises DataError."""
        try:
            said = json.loads(read_bytes(path, "a camera"))
            matrix = np.array(said["matrix"], dtype=float).reshape(3, 3)
            few = np.array(said.get("distortion", []), dtype=float).ravel()[:5]
        except (ValueError, KeyError, TypeError, AttributeError):
            wanted = '{"matrix": 3 x 3 numbers, "distortion": up to 5}'
            raise DataError(STAGE_PHOTO(file=path, wanted=wanted)) from None
        return cls(matrix, np.concatenate([few, np.zeros(5 - len(few))]))


def find_camera(
    stage: TableStage, photo: Photograph, lens: Lens | None = None, start: GradedStart | None = None
) -> StageCamera:
    """The camera of a photograph. Where tags of the mat are missing, those on the objects of `start` help: they lie
    level, and their sizes and heights are known. Raises DataError where no tag of the mat is seen, and where they do
    not lie as on the stage's mat."""
    seen = [tag for tag in range(MAT_TAGS) if tag in photo.tags]
    if not seen:
        turned = Photograph.from_picture(photo.picture[:, ::-1].copy(), photo.name)
        if any(tag in turned.tags for tag in range(MAT_TAGS)):
            raise DataError(STAGE_PHOTO(file=photo.name, mirrored=True))
        raise DataError(STAGE_PHOTO(file=photo.name, count=0))
    level = [] if start is None or len(seen) == MAT_TAGS else stage.tops(start)
    squares = tuple((thing.side, height, photo.tags[thing.tag]) for thing, height in level if thing.tag in photo.tags)
    fit = _CameraFit(stage.tag_corners()[seen], np.concatenate([photo.tags[tag] for tag in seen]), photo, lens, squares)
    camera, off, _ = fit.solve()
    pixel = stage.tag / float(np.median([math.dist(*photo.tags[tag][:2]) for tag in seen]))
    most = max(MOST_OFF, max(stage.size) / 1000.0, pixel)
    if off > most:
        _, rest, sizes = replace(fit, free=True).solve()
        if rest <= most and np.abs(sizes - 1.0).max() > OTHER_SIZE:
            apart = (stage.tag_corners()[2, 0] - stage.tag_corners()[0, 0]) / stage.tag
            facts = {"found": "{:.1f} x {:.1f}".format(*apart * sizes), "wanted": "{:.1f} x {:.1f}".format(*apart)}
            raise DataError(STAGE_MAT(file=photo.name, **facts))
        raise DataError(STAGE_MAT(file=photo.name, off=1000.0 * off, most=1000.0 * most))
    return camera


@dataclass(frozen=True, slots=True, eq=False)
class _CameraFit:
    """Corners (T, 4, 2) of tags of the mat, seen at pixels (4 T, 2); `squares` are other tags that lie level: side,
    height, and pixels (4, 2). Parameters are turn, shift, log of the focal length, k1, and the principal point from the
    middle in longer sides; x, y and heading of each square; where they are `free`, also logs of by how much the tags'
    distances along x and y differ."""

    flat: Array
    pixels: Array
    photo: Photograph
    lens: Lens | None
    squares: tuple[tuple[float, float, Array], ...] = ()
    free: bool = False

    def solve(self) -> tuple[StageCamera, float, Array]:
        """The camera, how far off the mat's corners are at most, in metres, and the sizes (2,) of the mat relative to
        what it should be."""
        import cv2

        long, (usual, _) = max(self.photo.picture.shape), self.focal
        starts = []
        for focal in [usual] if self.lens or self.photo.focal else [share * long for share in FOCAL_STARTS]:
            others = LENS_PARAMETERS - 1 + TAG_PARAMETERS * len(self.squares) + 2 * self.free
            start = np.array([0.0] * POSE_PARAMETERS + [math.log(focal)] + [0.0] * others)
            guess = self.camera(start)
            _, turns, shifts, _ = cv2.solvePnPGeneric(
                self.points(start), self.pixels, guess.matrix, guess.distortion, flags=cv2.SOLVEPNP_IPPE
            )
            for one, by in zip(turns, shifts, strict=True):
                there = np.concatenate([one.ravel(), by.ravel(), start[POSE_PARAMETERS:]])
                for k, (_, height, pixels) in enumerate(self.squares):
                    corners = self.camera(there).place(pixels, height)
                    across = corners[1] - corners[0]
                    self.square(there, k)[:] = *corners.mean(axis=0), math.atan2(across[1], across[0])
                starts.append(there)
        starts.sort(key=lambda one: float(np.square(self.residuals(one)).sum()))
        found = (_least_squares(self.residuals, one) for one in starts[:TRIED_STARTS])
        best, _, normal = min(found, key=itemgetter(1))
        values, ways = np.linalg.eigh(
            np.linalg.pinv(normal)[: POSE_PARAMETERS + LENS_PARAMETERS, : POSE_PARAMETERS + LENS_PARAMETERS]
        )
        offs = (ways * np.sqrt(values.clip(min=0.0))).T
        camera = replace(
            self.camera(best),
            doubts=tuple(self.camera(best[: POSE_PARAMETERS + LENS_PARAMETERS] + off) for off in offs),
        )
        off = camera.place(self.pixels, 0.0) - self.points(best)[:, :2]
        return camera, float(np.hypot(*off.T).max()), np.exp(best[-2:])

    @property
    def focal(self) -> tuple[float, float]:
        """The focal length that is likely, in pixels, and the standard deviation of its logarithm."""
        if self.photo.focal:
            return self.photo.focal, EXIF_SPREAD
        return FOCAL * max(self.photo.picture.shape), FOCAL_SPREAD

    def points(self, given: Array) -> Array:
        """(4 T, 3): the corners in the frame of the mat."""
        centres = self.flat.mean(axis=1, keepdims=True)
        sizes = np.exp(given[-2:]) if self.free else np.ones(2)
        flat = ((centres - centres.mean(axis=0)) * sizes + centres.mean(axis=0) + self.flat - centres).reshape(-1, 2)
        return np.column_stack([flat, np.zeros(len(flat))])

    def square(self, given: Array, k: int) -> Array:
        """The parameters of a square, to be read and set."""
        return given[POSE_PARAMETERS + LENS_PARAMETERS + TAG_PARAMETERS * k :][:TAG_PARAMETERS]

    def camera(self, given: Array) -> StageCamera:
        import cv2

        height, width = self.photo.picture.shape[:2]
        focal = math.exp(given[POSE_PARAMETERS])
        u, v = (given[8:10] * max(height, width) + ((width - 1) / 2.0, (height - 1) / 2.0)).tolist()
        matrix = np.array([[focal, 0.0, u], [0.0, focal, v], [0.0, 0.0, 1.0]])
        lens = self.lens or Lens(matrix, np.array([given[7], 0.0, 0.0, 0.0, 0.0]))
        return StageCamera(lens.matrix, lens.distortion, np.asarray(cv2.Rodrigues(given[:3])[0]), given[3:6])

    def residuals(self, given: Array) -> Array:
        """In standard deviations."""
        usual, spread = self.focal
        points, pixels = [self.points(given)], [self.pixels]
        for k, (side, height, seen) in enumerate(self.squares):
            x, y, theta = self.square(given, k).tolist()
            turn = np.array([[math.cos(theta), math.sin(theta)], [-math.sin(theta), math.cos(theta)]])
            points.append(np.column_stack([square_corners(side) @ turn + (x, y), np.full(4, height)]))
            pixels.append(seen)
        seen_at = self.camera(given).project(np.concatenate(points))
        off = (seen_at - np.concatenate(pixels)).ravel() / PIXEL_ERROR
        known = [
            (given[POSE_PARAMETERS] - math.log(usual)) / spread,
            given[7] / BEND_SPREAD,
            *given[8:10] / MIDDLE_SPREAD,
        ]
        return np.concatenate([off, known])


def _least_squares(residuals: Callable[[Array], Array], start: Array) -> tuple[Array, float, Array]:
    """Where the sum of squares is least, near a start, that sum, and the inverse of the covariance there; slopes by
    differences."""
    x, damping = start, 1e-3
    now = residuals(x)
    for _ in range(FIT_STEPS):
        steps = np.diag(SLOPE_STEP * np.maximum(np.abs(x), 1.0))
        slopes = np.array([(residuals(x + step) - now) / step.max() for step in steps]).T
        normal = slopes.T @ slopes
        move = np.linalg.solve(normal + damping * np.diag(normal.diagonal() + 1e-12), -slopes.T @ now)
        then = residuals(x + move)
        gain = float(now @ now - then @ then)
        if gain > 0.0:
            x, now, damping = x + move, then, max(damping / 10.0, 1e-9)
        else:
            damping *= 10.0
        if damping > 1e9 or 0.0 < gain < 1e-9 * (1.0 + now @ now):
            break
    return x, float(now @ now), normal
