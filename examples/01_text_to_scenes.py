"""From a line of text to verified scenes: no training, any spec."""

import scenegen

spec = scenegen.parse("(leftOf(fork, plate) | aboveOf(fork, plate)) & !closeTo(fork, plate, 0.15)")
print(spec, spec.bounds())

# eight scenes that miss the goal by 10 to 20 cm, spread evenly over that range
scenes = scenegen.sample(spec, phi={"task": (-0.2, -0.1)}, n=8, seed=1)
print(scenes)
for scene in scenes:
    fork, plate = scene.poses["fork"], scene.poses["plate"]
    print(f"phi {scene.phi['task']:+.3f}  fork ({fork.x:.2f}, {fork.y:.2f})  plate ({plate.x:.2f}, {plate.y:.2f})")
