"""Full scale of each signal, and how far a motion may go beyond what set it in motion."""

FULL_SCALE_M = 0.010  # the displacement that is 0 dBFS in sound
FULL_SCALE_M_S = 30.0  # the velocity that is 0 dBFS: a Gaussian of width 0.08 is as loud as its displacement
FULL_SCALE_N = 20.0  # the force at the bridge that is 0 dBFS: a Gaussian of width 0.06 and 20 mm on a nylon B3
FULL_SCALE_PA = 20.0  # the sound pressure at 1 m that is 0 dBFS, before the gain of a key
RUNAWAY_FACTOR = 20.0  # times its initial peak: a released string never exceeds about that peak
MOST_PERIODS = 1.0  # of the lowest mode: the longest that finger, hammer or mallet touches what they set in motion
LEAST_PEAK_M = 1e-4  # of an initial displacement, for that factor
MATCHED_S = 1.0  # from the pluck on: the part whose levels are matched
LARGEST_MATCH_DB = 40.0  # beyond this a source is silent rather than soft, and stays as it is


def match_gain(level: float, truth: float) -> float:
    """The factor that brings a source of this level, root mean square, to the level of the truth."""
    limit = 10 ** (LARGEST_MATCH_DB / 20)
    gain = truth / level if level > 0 else 0.0
    return gain if 1 / limit <= gain <= limit else 1.0
