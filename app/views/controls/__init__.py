"""Knobs, buttons, bars and labels."""
