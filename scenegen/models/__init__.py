"""Learned samplers: GAN and AAE, their codec, and model files. `table` lists them and imports no torch."""
