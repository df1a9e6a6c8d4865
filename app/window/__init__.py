"""The window, and what connects it to everything else."""
