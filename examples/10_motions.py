"""Motions at a chosen phi from a spec over time, and pairs of a start and a goal from one without."""

from pathlib import Path

import scenegen

spec = scenegen.load(Path(__file__).parent / "motions" / "sort_three.spec")
easy = scenegen.sample_motions(spec, phi=(0.05, None), n=10, seed=0)
print(f"{len(easy)} motions of {easy.poses.shape[1]} moments; phi at least {easy.phi['task'].min():.3f}")
print(f"objects go {easy.facts['way'].mean():.2f} m in all")

pairs = scenegen.pairs(scenegen.parse("leftOf(mug, plate) & closeTo(mug, plate, 20 cm)"), n=100, moved=1, seed=0)
print(f"{len(pairs)} tasks; the moved object is {pairs.facts['distance'].mean():.2f} m from its goal")
