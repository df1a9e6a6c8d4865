"""The sound output: devices, what can go wrong with them, and the thread that looks after the one that plays.

Nothing is imported here: settings name a device before the engine is loaded.
"""
