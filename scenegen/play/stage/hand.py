"""The world `hand:`, a person at a real table: is shown where things go, and asked whether they stand there and in the
end how it went. It talks on the terminal, so the keyboard is enough; after Ctrl-C a run can be resumed."""

from __future__ import annotations

import functools
from collections.abc import Callable
from dataclasses import dataclass, field
from operator import itemgetter
from pathlib import Path
from typing import Any, Literal, TextIO

from scenegen.arrays import Array
from scenegen.errors import DataError, ScenegenError
from scenegen.errors.worlds import STAGE_PHOTO, WORLD_FAILS
from scenegen.play.stage.camera import Lens, Photograph, find_camera, read_frames
from scenegen.play.stage.check import check_poses
from scenegen.play.stage.measure import check_table, poses_by_tags
from scenegen.play.stage.overlay import draw_overlay, judge_picture
from scenegen.play.stage.sheet import write_card
from scenegen.play.stage.stage import TableStage
from scenegen.play.suites.loading import HAND
from scenegen.play.suites.suite import GradedStart, Suite, SuiteTask
from scenegen.scenes.files import write_whole

TERMINAL = "/dev/tty"
PICTURE_ENDINGS = (".jpg", ".jpeg", ".png")
OVERLAY_FILE, CAMERA_FILE = "overlay.png", "camera.json"


def load_hand(role: Literal["world", "policy"], text: str) -> Callable[..., Any]:
    """The world of a person who puts pictures into the folder `text`, or has a camera of this name, or neither; or a
    policy that this person starts, which is only a name here."""
    if role == "policy":
        return lambda observation, instruction: None
    return functools.partial(make_hand, text)


def make_hand(source: str, task: SuiteTask, suite: Suite) -> HandWorld:
    """Raises OSError without a terminal, and for a source that is neither a folder nor a camera."""
    if source and not (Path(source).exists() or source.isdecimal() or "://" in source):
        raise FileNotFoundError(f"there is no folder {source} for pictures; make it first")
    terminal = Path(TERMINAL)
    return HandWorld(TableStage.from_suite(suite), source, terminal.open(), terminal.open("w"))


@dataclass(slots=True, eq=False)
class HandWorld:
    """Calls of Gymnasium, answered by a person who reads `screen` and writes on `keys`. Where `source` is a folder, the
    newest picture that came into it is looked at; otherwise it is a camera of OpenCV, or "" where nothing is looked at.
    overlay.png is written into the folder, or here; camera.json there says what is known of the camera. A policy acts
    on the robot itself in its one call of an episode."""

    stage: TableStage
    source: str
    keys: TextIO
    screen: TextIO
    start: GradedStart | None = None
    old: set[tuple[Path, int]] = field(default_factory=set)  # pictures that were looked at, or there before

    def reset(self, *, seed: int, options: dict[str, Any]) -> tuple[dict[str, Any], dict[str, Any]]:
        self.start = start = options["start"]
        self._say("", write_card(self.stage, start))
        if not self.source:
            self._ask("Enter when all stand there")
            return {}, {"success": None}
        self.old |= self._pictures()
        while True:
            picture = f" and a new picture is in {self.source}" if self._is_folder else ""
            self._ask(f"Enter when all stand there{picture}")
            poses = self._look()
            if poses is None:
                continue
            found = check_poses(start, poses)
            self._say(*found.lines(self.stage))
            if found.ok or self._ask("move it, or take it as it stands? [m]ove, [t]ake", "mt") == "t":
                named = {name: tuple(pose) for name, pose in zip(start.objects, poses.tolist(), strict=True)}
                return {}, {"success": None, "scene": {"poses": named, "phi": found.phi}}

    def step(self, action: object) -> tuple[dict[str, Any], float, bool, bool, dict[str, Any]]:
        assert self.start is not None
        question = f"did it succeed? [y]es, [n]o{', [p]hi of a new picture' if self.source else ''}"
        while (said := self._ask(question, "ynp" if self.source else "yn")) == "p":
            if (poses := self._look()) is not None:
                phi = check_poses(self.start, poses).phi
                self._say(f"phi {phi:.4f}: {'a success' if phi >= 0.0 else 'a failure'}")
                return {}, 0.0, True, False, {"success": bool(phi >= 0.0)}
        return {}, 0.0, True, False, {"success": said == "y"}

    def close(self) -> None:
        for stream in (self.keys, self.screen):
            stream.close()

    def _look(self) -> Array | None:
        """Where things stand in a new picture; None where it does not show that, and why is said."""
        assert self.start is not None
        place = Path(self.source if self._is_folder else "")
        try:
            photo, lens = self._photograph(), place / CAMERA_FILE
            camera = find_camera(self.stage, photo, Lens.read(lens) if lens.exists() else None, self.start)
            said = judge_picture(self.stage, self.start, photo, camera)
            write_whole(place / OVERLAY_FILE, draw_overlay(self.stage, self.start, photo, camera, said))
            self._say(f"where things go is in {place / OVERLAY_FILE}")
            poses = poses_by_tags(self.stage, self.start, photo, camera)
            check_table(self.stage, self.start, poses)
        except DataError as error:
            self._say(str(error.diagnostics[0]))
            return None
        return poses

    def _photograph(self) -> Photograph:
        """Raises DataError."""
        if not self._is_folder:
            return Photograph.from_picture(next(read_frames(self.source)), f"camera {self.source}")
        new = self._pictures() - self.old
        if not new:
            raise DataError(STAGE_PHOTO(folder=self.source))
        self.old |= new
        return Photograph.read(max(new, key=itemgetter(1))[0])

    @property
    def _is_folder(self) -> bool:
        return bool(self.source) and Path(self.source).is_dir()

    def _pictures(self) -> set[tuple[Path, int]]:
        """Those in the folder, and when each was written."""
        files = Path(self.source).iterdir() if self._is_folder else ()
        names = (one for one in files if one.suffix.lower() in PICTURE_ENDINGS and one.name != OVERLAY_FILE)
        return {(one, one.stat().st_mtime_ns) for one in names}

    def _ask(self, question: str, choices: str = "") -> str:
        """A key of the choices, or just Enter where there are none. Raises ScenegenError where the terminal is gone."""
        while True:
            self.screen.write(f"{question}: ")
            self.screen.flush()
            if not (line := self.keys.readline()):  # Ctrl-D: no failure of the policy, but the end of the run
                how, reason = "cannot go on", "nobody is at the terminal"
                raise ScenegenError(WORLD_FAILS(what="the world", name=HAND, how=how, reason=reason))
            said = line.strip().lower()[:1]
            if not choices or (said and said in choices):
                return said

    def _say(self, *lines: str) -> None:
        self.screen.write("".join(f"{line}\n" for line in lines))
        self.screen.flush()
