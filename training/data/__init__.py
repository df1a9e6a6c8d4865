"""Data sets from the reference solver, their cache, and batches of them."""
