"""Scenes into PyBullet: push the mug to the left, and see what that does to the task."""

import pybullet
import torch

import scenegen

spec = scenegen.parse("object mug, plate\ntask: leftOf(mug, plate)\nrequire noOverlap()")
phi = spec.robustness()
scenes = scenegen.sample(spec, phi={"task": (-0.1, -0.01)}, n=4, seed=1)
poses, _ = scenes.to_torch()
client = pybullet.connect(pybullet.DIRECT)

for scene, pose in zip(scenes, poses, strict=True):
    pybullet.resetSimulation(physicsClientId=client)
    pybullet.setGravity(0, 0, -9.81, physicsClientId=client)
    bodies = scenegen.load_pybullet(scene, client)
    before, _ = pybullet.getBasePositionAndOrientation(bodies["mug"], physicsClientId=client)
    pybullet.resetBaseVelocity(bodies["mug"], linearVelocity=(-0.8, 0, 0), physicsClientId=client)
    for _ in range(240):
        pybullet.stepSimulation(physicsClientId=client)
    after, _ = pybullet.getBasePositionAndOrientation(bodies["mug"], physicsClientId=client)
    pose[0, :2] += torch.tensor(after[:2]) - torch.tensor(before[:2])
    print(f"phi {scene.phi['task']:+.3f}, after the push {phi(pose[None]).item():+.3f}")
