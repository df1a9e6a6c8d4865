"""What an instrument is played on and turned with: keys, a neck, knobs of the string, bar and browser of patches.

Gestures emit signals; setters show what became of them. `panel` holds all but the browser in one strip.
"""
