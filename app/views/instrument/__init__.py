"""What an instrument is played on and turned with: keys, a neck, knobs of the string, bar and browser of patches.

Widgets alone: signals say what hands do, setters what became of it. `panel` holds them together in one strip.
"""
