"""Training: data sets from the reference solver, and models fitted to them, down to a preset file."""
