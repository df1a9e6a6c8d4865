"""The figures of model and truth that the views show, computed without a window: arrays in, arrays out.

What is computed from a take while it is rendered grows with each call (`growing.py`); what takes long is given a job
(`app.shared.worker`), which receives its progress and cancels it.
"""
