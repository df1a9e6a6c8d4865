"""Figures of presets and runs: each function returns one `matplotlib.figure.Figure`.

`ratios`         our errors over the paper's, a heat map
`family_errors`  errors of a model of many strings, by rise of tension
`style`          how they look, and their files
"""
