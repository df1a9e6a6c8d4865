"""The safety limiter: its gain falls before the peak that it is for, so smoothly that nothing clicks.

The input waits for `AHEAD` frames. The gain that a frame needs is held for as long: the highest of the last
`AHEAD` + 1 frames, or what is left of an earlier peak by an exponential release. Then it is averaged over as many
frames. Each of these gains has held what the delayed frame needs, so their mean is low enough for it.
The average is two moving averages, one of the other: a triangle of weights, so that the gain has no corners. It
changes by `STEEPEST` a frame at most. The form is well known: peak hold, release, stacked moving averages and delay,
as in G. Luff, "Designing a straightforward limiter", Signalsmith Audio, 2022.
"""

from __future__ import annotations

from engine.kernels.compiled import kernel
from engine.kernels.constants import AHEAD, QUANTUM
from engine.kernels.mixer_records import Mixer

CEILING = 10 ** (-0.3 / 20)
LARGEST_LEVEL = 100.0  # +40 dBFS: the level that is believed at most, so that one wild sample is soon forgotten
_SIDE = AHEAD // 2 + 1  # frames of either average
STEEPEST = 1 / _SIDE  # of the gain a frame, were it to fall to nothing


@kernel
def limit(mixer: Mixer) -> None:
    """Take the mix, (QUANTUM, 2), and leave there what is `AHEAD` frames older, within ±`CEILING`.

    Where nothing within reach exceeds the ceiling, samples stay as they are.
    """
    mix, waiting = mixer.mix[:], mixer.waiting[:]
    peaks, gains = mixer.peaks[:], mixer.gains[:]
    for frame in range(QUANTUM):
        left, right = mix[frame, 0], mix[frame, 1]
        waiting[AHEAD + frame, 0], waiting[AHEAD + frame, 1] = left, right
        peaks[AHEAD + frame] = min(max(abs(left), abs(right)), LARGEST_LEVEL)
    if mixer.limiter > CEILING or peaks.max() > CEILING or gains[:AHEAD].min() < 1.0:
        _reduce(mixer)
    else:
        gains[AHEAD:] = 1.0
        mix[:] = waiting[:QUANTUM]
    for frame in range(AHEAD):
        waiting[frame, 0], waiting[frame, 1] = waiting[QUANTUM + frame, 0], waiting[QUANTUM + frame, 1]
        peaks[frame], gains[frame] = peaks[QUANTUM + frame], gains[QUANTUM + frame]


@kernel
def _reduce(mixer: Mixer) -> None:
    """Write the quantum that waited, times its gain, to the mix; keep the level that is held and the least gain."""
    mix, waiting = mixer.mix[:], mixer.waiting[:]
    peaks, gains = mixer.peaks[:], mixer.gains[:]
    level, reduction = mixer.limiter, mixer.reduction
    for frame in range(AHEAD, AHEAD + QUANTUM):
        level *= mixer.release
        for before in range(AHEAD + 1):
            level = max(level, peaks[frame - before])
        gains[frame] = min(1.0, CEILING / level)
    for frame in range(QUANTUM):
        total = 0.0
        for after in range(AHEAD + 1):  # the weights are whole numbers: a gain of 1 throughout remains exactly that
            total += (min(after, AHEAD - after) + 1) * gains[frame + after]
        gain = total / _SIDE**2
        reduction = min(reduction, gain)
        for side in range(2):
            mix[frame, side] = min(max(waiting[frame, side] * gain, -CEILING), CEILING)
    mixer.limiter, mixer.reduction = level, reduction
