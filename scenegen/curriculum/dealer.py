"""What begins an episode: what `reset` is asked for, made into a scene."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt
from gymnasium import error

from scenegen.api.spec import Spec
from scenegen.curriculum.faults import as_gymnasium, sentence
from scenegen.curriculum.feed import Dealt, Feed
from scenegen.curriculum.library import Library, open_library
from scenegen.curriculum.request import Wanted, check_options, everything, read_phi, read_scene
from scenegen.curriculum.rules import Rules, Tables
from scenegen.curriculum.sources import check_source
from scenegen.errors import RequestError

Array = npt.NDArray[np.float64]

TINY = 1e-300  # "not satisfied" ends a hair below 0, which nobody wants to read


@dataclass(frozen=True, slots=True, eq=False)
class Ask:
    """Checked options: the scene that was given, or what is wanted of one; both None where the options say nothing."""

    scene: Tables | None = None
    wanted: Wanted | None = None
    nearest: bool = False


class Dealer:
    """Deals scenes. `phi` is what is asked for where options say nothing. The library is opened when it is first
    needed: an environment that is only given scenes never draws one."""

    def __init__(self, spec: Spec, rules: Rules, source: Any, phi: object) -> None:
        self._spec, self._aim, self._source = spec, rules.aim, source
        self._score = rules.score
        self._usual = None if phi is None else read_phi(rules.aim, phi)
        self._library: Library | None = None
        check_source(source)

    @property
    def library(self) -> Library:
        """Raises gymnasium.error.Error where the source is no good, or every scene satisfies the goal."""
        if self._library is None:
            with as_gymnasium():
                self._library = open_library(self._aim, self._spec, self._source)
        return self._library

    def feed(self, rng: np.random.Generator) -> Feed:
        """Scenes from the seed of a generator."""
        return Feed(self.library, int(rng.integers(2**63)))

    def read(self, options: Mapping[str, Any] | None) -> Ask:
        """Check options. Raises gymnasium.error.Error, and InvalidBound for ranges that cannot be."""
        if options is None:  # most often
            return Ask()
        options = check_options(options)
        if options.get("scene") is not None:
            return Ask(scene=self._given(read_scene(self._spec, options["scene"])[:, None]))
        nearest, phi = bool(options.get("nearest", False)), options.get("phi")
        return Ask(wanted=None if phi is None else read_phi(self._aim, phi, points=nearest), nearest=nearest)

    def task(self, ask: Ask) -> Array:
        """(D, 2): the lowest and highest phi that are asked for."""
        wanted = everything(self._aim) if ask.scene is not None else self._wanted(ask)
        task = np.array([wanted.low, wanted.high]).T
        task[np.abs(task) < TINY] = 0.0
        return task

    def _given(self, rows: Array) -> Tables:
        """A scene (3N, 1) that was verified when it was read."""
        phi, slack = self._score(rows), np.zeros(1)
        if self._score.requires:
            phi, slack = phi[:-1], np.minimum(phi[-1], 0.0)
        return Tables(rows, phi, slack)

    def deal(self, feed: Feed, ask: Ask) -> Dealt:
        """A scene that is wanted, and its phi. Raises gymnasium.error.InvalidBound where that is out of reach."""
        wanted = self._wanted(ask)
        try:
            return feed.take(wanted, nearest=ask.nearest)
        except RequestError as problem:
            raise error.InvalidBound(f"{sentence(problem)}; {self._nearest(wanted)}") from problem

    def _wanted(self, ask: Ask) -> Wanted:
        if ask.wanted is not None:
            return ask.wanted
        if self._usual is not None:
            return self._usual
        if self.library.hard >= 0.0:
            raise error.Error("every scene of the source satisfies the goal already; ask for a `phi` to begin with")
        return self.library.unsatisfied

    def _nearest(self, wanted: Wanted) -> str:
        """What there is near a range that is out of reach."""
        found, names = self.library.met(wanted), self._aim.names
        parts = [f"phi of `{names[k]}` {found[k]:.4g}" for k in wanted.dims]
        return f"the nearest scene that was met has {' and '.join(parts)}"
