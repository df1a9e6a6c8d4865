"""Parts that an instrument is played and turned with: keys, a neck, string knobs, bar and browser of instruments.

Gestures emit signals; setters show what became of them. `panel` holds all but the browser in one strip.
"""
