"""Instruments: an instrument and all its choices, the places of instruments, and the tuning of their keys."""
