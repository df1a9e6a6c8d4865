"""Sounds as files: WAV and FLAC with their recipes, what was played, and instruments for samplers (`sampled`)."""
