"""The world `hand:`, a person at a real table: is shown where things go, and asked whether they stand there and in the
end how it went. It talks on the terminal, so the keyboard is enough; after Ctrl-C a run can be resumed."""

from __future__ import annotations

import functools
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal, TextIO

from scenegen.arrays import Array
from scenegen.errors import DataError
from scenegen.errors.worlds import STAGE_PHOTO
from scenegen.play.stage.camera import Lens, Photograph, find_camera
from scenegen.play.stage.check import check_poses
from scenegen.play.stage.measure import check_table, poses_by_tags
from scenegen.play.stage.overlay import draw_overlay
from scenegen.play.stage.sheet import write_card
from scenegen.play.stage.stage import TableStage
from scenegen.play.suites.suite import GradedStart, Suite, SuiteTask
from scenegen.scenes.files import write_whole

TERMINAL = "/dev/tty"
PICTURE_ENDINGS = (".jpg", ".jpeg", ".png")
OVERLAY_FILE, CAMERA_FILE = "overlay.png", "camera.json"


def load_hand(role: Literal["world", "policy"], text: str) -> Callable[..., Any]:
    """The world of a person who puts pictures into the folder `text`, or has none; or a policy that this person starts,
    which is only a name here."""
    if role == "policy":
        return lambda observation, instruction: None
    return functools.partial(make_hand, text)


def make_hand(folder: str, task: SuiteTask, suite: Suite) -> HandWorld:
    """Raises OSError without a terminal, and without that folder."""
    if folder and not Path(folder).is_dir():
        raise FileNotFoundError(f"there is no folder {folder} for pictures; make it first")
    terminal = Path(TERMINAL)
    return HandWorld(
        TableStage.from_suite(suite), Path(folder) if folder else None, terminal.open(), terminal.open("w")
    )


@dataclass(slots=True, eq=False)
class HandWorld:
    """Calls of Gymnasium, answered by whoever reads `screen` and writes on `keys`. With a `folder` the newest picture
    in it is looked at, and camera.json in it says what is known of the camera; overlay.png is written there. A policy
    acts on the robot itself in its one call of an episode."""

    stage: TableStage
    folder: Path | None
    keys: TextIO
    screen: TextIO
    start: GradedStart | None = None

    def reset(self, *, seed: int, options: dict[str, Any]) -> tuple[dict[str, Any], dict[str, Any]]:
        self.start = start = options["start"]
        self._say("", write_card(self.stage, start))
        if self.folder is None:
            self._ask("Enter when all stand there")
            return {}, {"success": None}
        while True:
            self._ask(f"Enter when all stand there and a new picture is in {self.folder}")
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
        look = self.folder is not None
        question = f"did it succeed? [y]es, [n]o{', [p]hi of a new picture' if look else ''}"
        while (said := self._ask(question, "ynp" if look else "yn")) == "p":
            if (poses := self._look()) is not None:
                phi = check_poses(self.start, poses).phi
                self._say(f"phi {phi:.4f}: {'a success' if phi >= 0.0 else 'a failure'}")
                return {}, 0.0, True, False, {"success": bool(phi >= 0.0)}
        return {}, 0.0, True, False, {"success": said == "y"}

    def close(self) -> None:
        for stream in (self.keys, self.screen):
            stream.close()

    def _look(self) -> Array | None:
        """Where things stand in the newest picture; None where it does not show that, and why is said."""
        assert self.folder is not None and self.start is not None
        try:
            files = [one for one in self.folder.iterdir() if one.suffix.lower() in PICTURE_ENDINGS]
            pictures = sorted(
                (one for one in files if one.name != OVERLAY_FILE), key=lambda one: one.stat().st_mtime_ns
            )
            if not pictures:
                raise DataError(STAGE_PHOTO(file=self.folder, count=0))
            lens = self.folder / CAMERA_FILE
            photo = Photograph.read(pictures[-1])
            camera = find_camera(self.stage, photo, Lens.read(lens) if lens.exists() else None)
            write_whole(self.folder / OVERLAY_FILE, draw_overlay(self.stage, self.start, photo, camera, rendered=False))
            poses = poses_by_tags(self.stage, self.start, photo, camera)
            check_table(self.stage, self.start, poses)
        except DataError as error:
            self._say(str(error.diagnostics[0]), f"where things go is in {self.folder / OVERLAY_FILE}")
            return None
        return poses

    def _ask(self, question: str, choices: str = "") -> str:
        """A key of the choices, or just Enter where there are none. Raises EOFError where the terminal is gone."""
        while True:
            self.screen.write(f"{question}: ")
            self.screen.flush()
            line = self.keys.readline()
            if not line:
                raise EOFError("nobody is at the terminal")
            said = line.strip().lower()[:1]
            if not choices or (said and said in choices):
                return said

    def _say(self, *lines: str) -> None:
        self.screen.write("".join(f"{line}\n" for line in lines))
        self.screen.flush()
