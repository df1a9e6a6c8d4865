"""What an instrument is: a patch and all its choices, where patches lie, and how their keys are tuned."""
