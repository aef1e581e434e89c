"""The models that are compared: each kind by the paper's recipe, where it has one, and by ours."""

from __future__ import annotations

from dataclasses import dataclass

from scenegen.experiments.plan import Sizes
from scenegen.experiments.problems import Problem

PAPER_EPOCHS = 50


@dataclass(frozen=True, slots=True)
class Variant:
    """`family` is the model's name in MODELS; `name` is what reports call it."""

    name: str
    family: str
    recipe: str

    def options(self, problem: Problem, sizes: Sizes) -> dict[str, int | str]:
        """What scenegen.train is told, the seed apart: the paper's settings spelt out, nothing for our own recipes."""
        found: dict[str, int | str] = {"recipe": self.recipe}
        if self.recipe == "paper":
            found |= {
                "epochs": PAPER_EPOCHS,
                "batch_size": problem.batch,
                "data": problem.data,
                "scenes": problem.scenes,
            }
        if sizes.epochs is not None:
            found["epochs"] = sizes.epochs
        if sizes.training is not None:
            found["scenes"] = sizes.training
        return found


VARIANTS: tuple[Variant, ...] = (
    Variant("GAN, paper's recipe", "gan", "paper"),
    Variant("AAE, paper's recipe", "aae", "paper"),
    Variant("GAN", "gan", "default"),
    Variant("AAE", "aae", "default"),
    Variant("flow", "gan", "default"),
    Variant("energy", "aae", "default"),
)
