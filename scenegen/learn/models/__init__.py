"""Learned samplers: energy-score generator, flow, GAN and AAE, the published networks, and model files. `table` lists
them and imports no torch."""
