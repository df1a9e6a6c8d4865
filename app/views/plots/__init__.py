"""Curves and pictures of what is measured."""
