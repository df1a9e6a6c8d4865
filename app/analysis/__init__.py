"""What views show of model and truth, computed without a window."""
