"""One model, many strings: a distribution of strings, what is learned from them, and how well on others.

strings     which strings there are, and plucks of them
motions     their true motions, cached
fit         the curves of `koopman_tension`, by least squares
errors      of any model of many strings, by string
baselines   models by others, made to take any string
fit_baseline   their training
preset      a run as a whole: configuration to preset
"""
