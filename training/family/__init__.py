"""The learning of one model from many strings: their distribution, what is learned, and how well on others.

motion      a string or a drum from its release on: the truth, players, and their errors
strings     which strings there are, and plucks of them
fit         the curves of `koopman_tension`, by least squares
errors      of any model of many strings, by string
drums       the same of drums
preset      a run as a whole: configuration to preset
"""
