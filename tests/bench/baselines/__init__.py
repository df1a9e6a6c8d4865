"""Models by others, made to take any string and trained on the family: rows of a comparison, and no presets."""
