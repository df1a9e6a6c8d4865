"""The learning of one model from many strings: their distribution, what is learned, and how well on others.

strings     which strings there are, plucks of them, and their true motions
fit         the curves of `koopman_tension`, by least squares
errors      of any model of many strings, by string
drums       the same of drums
preset      a run as a whole: configuration to preset
"""
