"""Figures of presets and runs: each function returns one `matplotlib.figure.Figure`.

`extrapolation`  past the end of training (the paper's Fig. 3)
`family_map`     errors of a model of many strings, a dot each string
`run_plot`       the course of a run, from its log
`style`          how they look, and their files
"""
