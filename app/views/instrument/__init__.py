"""Widgets that play and change an instrument: keys, a neck, string knobs, its bar, and the browser to choose it.

Gestures emit signals; setters show what became of them. `panel` holds all but the browser in one strip.
"""
