"""The errors between two sounds or motions, of a model and the truth.

`relative`      sums of squared and absolute errors, relative to the truth
`partials`      level, phase, frequency and decay of each mode, against the truth's phasors
`spectra`       distances of magnitude spectra, at several resolutions and above a floor
`audible`       what an ear finds: spectrum, level, pitch
"""
