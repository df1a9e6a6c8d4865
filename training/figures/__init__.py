"""Figures of presets and runs: each function returns one `matplotlib.figure.Figure`.

`extrapolation`  past the end of training (the paper's Fig. 3)
`ratios`         our errors over the paper's, a heat map
`family_errors`  errors of a model of many strings, by rise of tension
`run_plot`       the course of a run, from its log
`style`          how they look, and their files
"""
