"""Sounds as files: WAV with their recipes, batches of them, what was played, and patches for samplers (`sampled`)."""
