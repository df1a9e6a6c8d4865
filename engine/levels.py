"""Full scale of each signal, and how far a motion may go beyond what set it in motion."""

FULL_SCALE_M = 0.010  # the displacement that is 0 dBFS in sound
FULL_SCALE_M_S = 30.0  # the velocity that is 0 dBFS: a Gaussian of width 0.08 is as loud as its displacement
FULL_SCALE_N = 20.0  # the force at the bridge that is 0 dBFS: a Gaussian of width 0.06 and 20 mm on a nylon B3
FULL_SCALE_PA = 20.0  # the sound pressure at 1 m that is 0 dBFS, before the gain of a key
RUNAWAY_FACTOR = 20.0  # times its initial peak: a released string never exceeds about that peak
MOST_PERIODS = 1.0  # of the lowest mode: the longest that finger, hammer or mallet touches what they set in motion
LEAST_PEAK_M = 1e-4  # of an initial displacement, for that factor
