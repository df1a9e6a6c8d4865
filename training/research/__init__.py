"""Research beside the product: what learned models are compared with, and starts that no preset needs to sound.

players         what knows the physics of a string and learned nothing, as rows of a comparison
fourier_wiring  Fourier cells wired as a string of given modes
"""
