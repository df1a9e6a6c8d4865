"""The ABX listening test: can A and B be told apart by ear alone? Rules, sound and record, without a window.

`trials.py` has the order, the score and the p-value, `sound.py` what is played, `record.py` the file that is kept.
"""
