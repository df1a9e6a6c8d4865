"""Small helpers for every package of `app`: version, log, memory, thread priority, whole files, vocabulary."""
