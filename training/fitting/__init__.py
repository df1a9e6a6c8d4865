"""Fitting a model to a data set: where it sets out, what is minimised, the loop, its checkpoints."""
