"""The presets that can be chosen: finding, installing and filtering them, and their facts in words."""
