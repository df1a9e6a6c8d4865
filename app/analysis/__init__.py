"""What views show of model and truth, computed without a window: arrays in, arrays out.

What grows with a take computes a little more at each call (`growing.py`); what takes long is a job that reports and
can be cancelled (`job.py`).
"""
