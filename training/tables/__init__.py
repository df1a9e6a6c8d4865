"""The paper's tables with our results beside them."""
