"""The ABX listening test (can A and B be distinguished by ear?) without a window: rules, sounds and results.

`trials.py` has the order, the score and the p-value, `sound.py` the stimuli, `record.py` the saved result.
"""
