"""Sounds as files."""
