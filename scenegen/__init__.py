"""scenegen: table-top scenes from a spatial specification, at the difficulty you ask for.

    import scenegen
    spec = scenegen.parse("leftOf(mug, plate) & !closeTo(mug, plate, 0.25)")
    scenes = scenegen.sample(spec, phi={"task": (0.0, 0.2)}, n=100, seed=0)

Importing the package loads nothing heavy: each name is looked up when it is first used.
"""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING, Any

from scenegen.resources import __version__

# name -> the module that defines it
_PUBLIC = {
    "Spec": "scenegen.api.spec",
    "load": "scenegen.api.spec",
    "parse": "scenegen.api.spec",
    "Scene": "scenegen.api.scenes",
    "SceneSet": "scenegen.api.scenes",
    "read_scenes": "scenegen.api.reading",
    "StoredSet": "scenegen.api.stored",
    "open_set": "scenegen.api.stored",
    "MotionSet": "scenegen.api.motions",
    "read_motions": "scenegen.api.motions",
    "Monitor": "scenegen.api.monitor",
    "sample_motions": "scenegen.api.motions",
    "pairs": "scenegen.api.pairs",
    "load_pybullet": "scenegen.worlds.physics.rest",
    "rarity": "scenegen.api.rarity",
    "sample": "scenegen.api.sample",
    "sample_to": "scenegen.api.stream",
    "settle": "scenegen.worlds.physics.rest",
    "SettledScenes": "scenegen.worlds.physics.rest",
    "Written": "scenegen.api.sample",
    "grammar_of": "scenegen.editors.grammars.grammar",
    "import_problem": "scenegen.planning.conversion",
    "export_problems": "scenegen.planning.conversion",
    "train": "scenegen.learn.train",
    "Model": "scenegen.learn.model",
    "ModelFamily": "scenegen.learn.model",
    "load_model": "scenegen.learn.model",
}
_ERRORS = ("ScenegenError", "SpecError", "RequestError", "DataError", "OutputError", "Diagnostic")

__all__ = [
    "DataError",
    "Diagnostic",
    "Model",
    "ModelFamily",
    "Monitor",
    "MotionSet",
    "OutputError",
    "RequestError",
    "Scene",
    "SceneSet",
    "ScenegenError",
    "SettledScenes",
    "Spec",
    "SpecError",
    "StoredSet",
    "Written",
    "__version__",
    "export_problems",
    "grammar_of",
    "import_problem",
    "load",
    "load_model",
    "load_pybullet",
    "open_set",
    "pairs",
    "parse",
    "rarity",
    "read_motions",
    "read_scenes",
    "sample",
    "sample_motions",
    "sample_to",
    "settle",
    "train",
]

if TYPE_CHECKING:
    from scenegen.api.monitor import Monitor
    from scenegen.api.motions import MotionSet, read_motions, sample_motions
    from scenegen.api.pairs import pairs
    from scenegen.api.rarity import rarity
    from scenegen.api.reading import read_scenes
    from scenegen.api.sample import Written, sample
    from scenegen.api.scenes import Scene, SceneSet
    from scenegen.api.spec import Spec, load, parse
    from scenegen.api.stored import StoredSet, open_set
    from scenegen.api.stream import sample_to
    from scenegen.editors.grammars.grammar import grammar_of
    from scenegen.errors import DataError, Diagnostic, OutputError, RequestError, ScenegenError, SpecError
    from scenegen.learn.model import Model, ModelFamily, load_model
    from scenegen.learn.train import train
    from scenegen.planning.conversion import export_problems, import_problem
    from scenegen.worlds.physics.rest import SettledScenes, load_pybullet, settle


def __getattr__(name: str) -> Any:
    if name in _PUBLIC:
        value = getattr(importlib.import_module(_PUBLIC[name]), name)
    elif name in _ERRORS:
        value = getattr(importlib.import_module("scenegen.errors"), name)
    else:
        raise AttributeError(f"module 'scenegen' has no attribute {name!r}")
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return sorted(__all__)
