"""phi is a differentiable torch function: move the objects of bad scenes until the scenes are good."""

import math

import torch

import scenegen

spec = scenegen.parse("leftOf(mug, plate) & !closeTo(mug, plate, 0.25)")
phi = spec.robustness()

generator = torch.Generator().manual_seed(0)
poses = torch.rand(1000, len(spec.objects), 3, generator=generator)
poses[..., 2] *= 2 * math.pi
poses.requires_grad_()
print(f"satisfied at first: {(phi(poses) >= 0).float().mean():.0%}")

optimiser = torch.optim.Adam([poses], lr=0.02)
for _ in range(100):
    optimiser.zero_grad()
    # beta: exact values, but the gradient reaches every object that matters, not the deciding pair alone
    loss = torch.relu(0.05 - phi(poses, beta=10.0)).sum()
    loss.backward()
    optimiser.step()
print(f"satisfied at last:  {(phi(poses) >= 0).float().mean():.0%}")
