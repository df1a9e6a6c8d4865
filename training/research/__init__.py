"""Research beside the product: what learned models are compared with, and starts that no preset needs to sound.

slow_flow       averaging of modes that share one tension, to third order, in which they trade energy; no learning
players         what knows the physics of a string and learned nothing, as rows of a comparison
baselines       models by others, made to take any string
fit_baseline    their training
fourier_wiring  Fourier cells wired as a string of given modes
"""
