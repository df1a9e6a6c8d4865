"""The engine: string physics, its reference solutions, learned models, metrics and presets.

It needs torch, numpy, scipy, numba and safetensors only, and knows no window and no sound device.
"""
