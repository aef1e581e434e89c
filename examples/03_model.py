"""Train a model, sample from it, and see what refinement changes. (Two epochs: enough to run, too few to be good.)"""

import tempfile
from pathlib import Path

import scenegen

spec = scenegen.parse("task: leftOf(mug, plate) & aboveOf(mug, plate)  safe: !closeTo(mug, plate, 0.25)")
wanted = {"task": (0.1, 0.2), "safe": (0.0, None)}

with tempfile.TemporaryDirectory() as folder:
    file = Path(folder) / "model.safetensors"
    scenegen.train(spec, "gan", out=file, epochs=2, scenes=4000, seed=0)
    model = scenegen.load_model(file)

    raw = scenegen.sample(model, wanted, n=500, seed=0, raw=True)
    fine = scenegen.sample(model, wanted, n=500, seed=0)

for name, scenes in (("raw", raw), ("refined", fine)):
    inside = (scenes.phi["task"] >= 0.1) & (scenes.phi["task"] <= 0.2) & (scenes.phi["safe"] >= 0.0)
    print(f"{name:8s} {inside.mean():4.0%} of the scenes are in the wanted range")
