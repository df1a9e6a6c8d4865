"""Benchmarks: what the program costs on this machine. Nothing is asserted."""
