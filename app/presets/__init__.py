"""Which presets there are, and their facts in words."""
