"""Instruments: a patch and all its choices, the places of patches, and the tuning of their keys."""
