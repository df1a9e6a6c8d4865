"""Figures of presets, as the paper's and as a talk needs them: each function returns one `matplotlib.figure.Figure`.

`evolution`      displacement of the whole string in time, and spectra (the paper's Fig. 2)
`extrapolation`  past the end of training (Fig. 3)
`error`          error per time step (Fig. 4)
`eigenvalues`    what was learned, in the unit circle
`ratios`         our errors over the paper's, a heat map
`family_errors`  errors of a model of many strings, by rise of tension
`run_plot`       the course of a run, from its log
`style`          how they look, and their files
"""
