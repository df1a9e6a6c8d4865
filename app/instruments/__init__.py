"""Instruments: checked values with all their choices, their files, and the tuning of their keys."""
