"""The models that are compared: whatever RECIPES has, by the paper's recipe and by ours."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from scenegen.experiments.plan import Sizes
from scenegen.experiments.problems import Problem
from scenegen.models.table import RECIPES
from scenegen.training.config import TrainConfig, make_config

ABBREVIATIONS = ("gan", "aae")


@dataclass(frozen=True, slots=True)
class Variant:
    """`family` is the model's name in MODELS."""

    family: str
    recipe: str

    @property
    def name(self) -> str:
        """What reports call it."""
        word = self.family.upper() if self.family in ABBREVIATIONS else self.family
        return f"{word}, paper's recipe" if self.recipe == "paper" else word

    def config(self, problem: Problem, sizes: Sizes, seed: int) -> TrainConfig:
        """The settings of a training: the paper's for this experiment, or our recipe's own for every one."""
        papers: dict[str, Any] = {"batch_size": problem.batch, "data": problem.data, "scenes": problem.scenes}
        smaller = {"epochs": sizes.epochs, "scenes": sizes.training, "data": sizes.data}
        options: dict[str, Any] = papers if self.recipe == "paper" else {}
        options |= {name: value for name, value in smaller.items() if value is not None}
        return make_config(self.family, self.recipe, seed=seed, **options)


VARIANTS: tuple[Variant, ...] = tuple(
    Variant(family, recipe) for recipe in ("paper", "default") for family in RECIPES[recipe]
)
