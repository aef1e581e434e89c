"""The models that are compared: the paper's and whatever MODELS has, in few steps and in many."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from experiments.plan import Sizes
from experiments.problems import Problem
from experiments.published import register
from scenegen.learn.model import ANY
from scenegen.learn.models.registry import MODELS
from scenegen.learn.training.config import TrainConfig, make_config

WORDS = {"gan": "GAN", "aae": "AAE", ANY: "any, tuned"}
OURS = tuple(MODELS)
MANY: dict[str, int] = {"flow": 8}  # models that take steps to make a scene -> how many, beside the few by default


@dataclass(frozen=True, slots=True)
class Variant:
    """`family` is the model's name in MODELS; by the recipe `paper` it is the published one. `steps` are those in which
    a scene is made, where that is not left to the model's own setting; training does not depend on it.
    """

    family: str
    recipe: str
    steps: int | None = None

    @property
    def name(self) -> str:
        """What reports call it."""
        word = WORDS.get(self.family, self.family)
        if self.recipe == "paper":
            return f"{word}, paper's recipe"
        return word if self.steps is None else f"{word}, {self.steps} steps"

    def config(self, problem: Problem, sizes: Sizes, seed: int) -> TrainConfig:
        """The settings of a training: the paper's for this experiment, or the model's own for every one."""
        papers: dict[str, Any] = {"batch_size": problem.batch, "data": problem.data, "scenes": problem.scenes}
        smaller = {"epochs": sizes.epochs, "scenes": sizes.training, "data": sizes.data}
        options: dict[str, Any] = papers if self.recipe == "paper" else {}
        options |= {name: value for name, value in smaller.items() if value is not None}
        register()
        return make_config(f"paper-{self.family}" if self.recipe == "paper" else self.family, seed=seed, **options)


VARIANTS: tuple[Variant, ...] = tuple(
    Variant(family, recipe, steps)
    for recipe in ("paper", "default")
    for family in (("gan", "aae") if recipe == "paper" else OURS)
    for steps in ((None, MANY[family]) if recipe == "default" and family in MANY else (None,))
)
