"""Plots and tables of what is measured."""
