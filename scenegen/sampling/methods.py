"""The sampling methods: one table for the command line, the Python API and `auto`."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class Method:
    """`make` is "module:function". It makes a plan from a problem and a budget; if `proposes`, also from a proposer.
    Raises RequestError if there is no scene, and that or StoppedError if time is up before there is a plan."""

    make: str
    good_for: str
    proposes: bool = False
    over_time: bool = False  # draws motions, too


METHODS: Mapping[str, Method] = {
    "auto": Method("scenegen.sampling.choice:choose", "takes the method below that needs least time", over_time=True),
    "rejection": Method("scenegen.sampling.rejection.sampler:make_plan", "most requests", over_time=True),
    "growth": Method("scenegen.sampling.growth.sampler:make_plan", "full tables"),
    "splitting": Method("scenegen.sampling.splitting.sampler:make_plan", "rare targets", over_time=True),
    "any": Method("scenegen.learn.any:make_plan", "a network that has learnt from other specs; approximate"),
    "model": Method("scenegen.learn.guided:make_plan", "a model file", proposes=True),
}


def methods_help() -> str:
    """The help of `--method`: `auto, rejection or splitting (a spec), model (a model file)`."""
    *most, last = [name for name, method in METHODS.items() if not method.proposes]
    proposing = [f"{name} (a model file)" for name, method in METHODS.items() if method.proposes]
    return ", ".join([f"{', '.join(most)} or {last} (a spec)", *proposing]) + "."
