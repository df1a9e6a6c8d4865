"""Benchmarks: what the program costs on this machine. Timings are medians of repeats; nothing is asserted."""
