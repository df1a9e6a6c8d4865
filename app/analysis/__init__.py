"""The figures of model and truth that the views show, computed without a window: arrays in, arrays out.

Figures of a take that is still rendered grow with each call. Long work is given a job
(`app.shared.worker`), which receives its progress and cancels it.
"""
