"""Learned samplers: flow, GAN, AAE, the model of any spec; and model files. `registry` lists them, without torch."""
