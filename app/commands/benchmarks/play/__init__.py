"""The program as its user meets it: keys from outside, and what the sound card was given, recorded."""
