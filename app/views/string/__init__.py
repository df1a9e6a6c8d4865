"""The string under the hands."""
