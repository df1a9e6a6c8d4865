"""What the user has chosen, and what follows from it.

Nothing is imported here: the window is painted before torch is loaded.
"""
