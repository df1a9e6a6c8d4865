"""The user's choices, and what follows from them.

Nothing is imported here: the window is painted before torch is loaded.
"""
