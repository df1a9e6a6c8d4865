"""What the views over time show, computed from a take: arrays in, arrays out, no window.

What takes longer grows with its take: `advance` computes a little more. See `growing.py`.
"""
