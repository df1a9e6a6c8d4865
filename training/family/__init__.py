"""The learning of one model from many strings: their distribution, what is learned, and how well on others.

strings     which strings there are, and plucks of them
motions     their true motions, cached
fit         the curves of `koopman_tension`, by least squares
errors      of any model of many strings, by string
preset      a run as a whole: configuration to preset
"""
