"""The ABX listening test (can A and B be told apart by ear?) without a window: rules, sounds and records.

`trials.py` has the order, the score and the p-value, `sound.py` what is played, `record.py` the file that is kept.
"""
