"""A guitar amplifier on the sum of all voices: drive and tone. Its cabinet is a body.

One channel, the mean of both. A high-pass as between stages, then gain, a bias and the shape x/√(1 + x²), whose
integral √(1 + x²) is known: its mean over each step of the input replaces its values (first-order antiderivative
antialiasing: J. D. Parker, V. Zavalishin, E. Le Bivic, "Reducing the aliasing of nonlinear waveshaping using
continuous-time convolution", DAFx 2016). That mean is (x₀ + x₁)/(√(1 + x₀²) + √(1 + x₁²)), without a difference of
near numbers. All of this at twelve times the rate. The bias gives even partials, as a single valve does
(J. Pakarinen, D. T. Yeh, Computer Music Journal 33/2 (2009) 85). Bias, high-pass and tone are estimates.
"""

from __future__ import annotations

import math

from engine.kernels.compiled import kernel
from engine.kernels.constants import QUANTUM
from engine.kernels.mixer_records import LAGS, LARGEST, OVERSAMPLING, SHAPED_FRAMES, SMALLEST, Amplifier, Mixer

NOMINAL = 0.15  # of full scale: a tone of this peak keeps its level, whatever the drive
BIAS = 0.25  # in the shape's own unit: 1 is where it bends most
COUPLING_HZ = 60.0  # high-pass before the drive
BLOCKING_HZ = 15.0  # high-pass behind it, for what the bias gives
PIVOT_HZ = 700.0  # of the tone, which raises one side and lowers the other
FADE_S = 0.020  # in which the amplifier is switched on or off
KAISER = 10.0  # of the window of the filter to and from the higher rate: images below -100 dB
PASSED = 0.4375  # of the rate: middle of the filter's edge, which ends at one half
REST_QUANTA = 400  # without input, after which all has died away
TAPS = LAGS * OVERSAMPLING


@kernel
def drive(mixer: Mixer, drive_db: float, tone_db: float, level_db: float) -> None:
    """Set the amplifier of a mixer, see `engine.values.effects.Amp`; a tone of the peak NOMINAL keeps its level.

    The input is scaled to the level that it would have without `level_db`, so that it changes no drive.

    Args:
        drive_db: gain before the shape; at 0 and below the amplifier is off.
        tone_db: gain of what lies above PIVOT_HZ; what lies below it is lowered as much.
    """
    amp, on = mixer.amplifier, drive_db > 0
    factor, level = 10 ** (drive_db / 20), 10 ** (level_db / 20)
    amp.wanted_gain = level * math.sqrt(1 + (factor * NOMINAL) ** 2) / factor if on else 0.0
    amp.wanted_tone = 10 ** (tone_db / 20) if on else 0.0
    amp.wanted_drive = factor / level if on else 0.0


@kernel
def amplify(mixer: Mixer) -> None:
    """Replace the mix, (QUANTUM, 2), by its sound through the amplifier, where it is on."""
    amp = mixer.amplifier
    wanted, share = amp.wanted_drive, amp.share
    if wanted == 0.0 and share == 0.0:
        amp.on = 0
        return
    first = mixer.frames == 0
    if amp.on == 0:
        _begin(amp)
    if wanted > 0.0 and (first or share == 0.0):
        amp.drive = wanted
        amp.gain, amp.tone = amp.wanted_gain, amp.wanted_tone
    sounds = _take(mixer, amp)  # whether there is any input
    amp.quiet = 0 if sounds else amp.quiet + 1
    goal = 1.0 if wanted > 0.0 else 0.0
    step = 1.0 if first else QUANTUM / (FADE_S * mixer.rate_hz)
    reached = min(share + step, goal) if goal > share else max(share - step, goal)
    amp.share = reached
    if amp.quiet > REST_QUANTA:
        return
    _shape(amp)
    _give(mixer, amp, goal if first else share, reached)


@kernel
def _begin(amp: Amplifier) -> None:
    """Reset the amplifier, as if there had never been any input, and compute its low-pass, (TAPS,) of sum 1.

    That is a sinc with a Kaiser window, for the way to the higher rate and back.
    """
    rest = BIAS / math.sqrt(1 + BIAS * BIAS)  # the shape's output without input
    amp.low = 0.0
    amp.last = BIAS
    amp.mean = rest
    amp.low_out = 0.0
    amp.input[:] = 0.0
    amp.shaped[:] = rest
    filter, total = amp.filter, 0.0
    for tap in range(TAPS):
        place = tap - (TAPS - 1) / 2  # from the middle, never 0: TAPS is even
        inside = 1 - (2 * place / TAPS) ** 2
        turns = 2 * math.pi * PASSED * place / OVERSAMPLING
        value = math.sin(turns) / turns * _bessel(KAISER * math.sqrt(inside))
        filter[tap] = value
        total += value
    for tap in range(TAPS):
        filter[tap] /= total
    amp.on = 1
    amp.quiet = 0


@kernel
def _bessel(x: float) -> float:
    """I₀(x), the modified Bessel function, by its power series Σ (x/2)^2k / k!².

    The Kaiser window of the amplifier's filter takes x of 0 … KAISER, where 40 terms are exact to rounding.
    """
    total = term = 1.0
    for k in range(1, 40):
        term *= (x / (2 * k)) ** 2
        total += term
    return total


@kernel
def _take(mixer: Mixer, amp: Amplifier) -> bool:
    """Take the mean of the mix's channels, through the high-pass, as the next input; return True if there is any.

    The last LAGS frames of the input before stay in front of it.
    """
    sounds, low = False, amp.low
    raw, mix = amp.input, mixer.mix
    follows = 1 - math.exp(-2 * math.pi * COUPLING_HZ / mixer.rate_hz)
    for frame in range(LAGS):
        raw[frame] = raw[QUANTUM + frame]
    for frame in range(QUANTUM):
        value = 0.5 * (mix[frame, 0] + mix[frame, 1])
        if not abs(value) < LARGEST or abs(value) < SMALLEST:
            value = 0.0
        sounds = sounds or value != 0.0
        low += follows * (value - low)
        raw[LAGS + frame] = value - low
    amp.low = low if abs(low) >= SMALLEST else 0.0
    return sounds


@kernel
def _shape(amp: Amplifier) -> None:
    """Bring the input to the higher rate, through drive, bias and shape, into `amp.shaped`.

    That is (OVERSAMPLING, SHAPED_FRAMES): the row is a sample within its frame; LAGS frames before stay in front.
    """
    filter = amp.filter
    raw = amp.input
    all_shaped = amp.shaped
    drive = amp.drive
    goal = amp.wanted_drive if amp.wanted_drive != 0.0 else drive  # it is switched off: as it was
    for row in range(OVERSAMPLING):
        out = all_shaped[row]
        for frame in range(LAGS):
            out[frame] = out[QUANTUM + frame]
        new = out[LAGS:]
        new[:] = 0.0
        for lag in range(LAGS):
            tap = OVERSAMPLING * filter[OVERSAMPLING * lag + row]
            delayed = raw[LAGS - lag : LAGS - lag + QUANTUM]
            for frame in range(QUANTUM):
                new[frame] += tap * delayed[frame]
        for frame in range(QUANTUM):
            new[frame] = BIAS + new[frame] * (drive + (goal - drive) * (frame + (row + 1) / OVERSAMPLING) / QUANTUM)
    before = amp.last
    root = math.sqrt(1 + before * before)
    for frame in range(LAGS, SHAPED_FRAMES):
        for row in range(OVERSAMPLING):
            value = all_shaped[row, frame]
            following = math.sqrt(1 + value * value)
            all_shaped[row, frame] = (before + value) / (root + following)
            before, root = value, following
    amp.last = before


@kernel
def _give(mixer: Mixer, amp: Amplifier, share: float, share_to: float) -> None:
    """Bring the shaped sound back to the rate of the mixer, without its mean, through gain and tone, into the mix.

    Its share of the mix goes from `share` to `share_to` within the quantum, as the amplifier is switched on or off.
    """
    filter = amp.filter
    out = amp.out
    mix = mixer.mix
    out[:] = 0.0
    for row in range(OVERSAMPLING):
        for lag in range(LAGS):
            tap = filter[OVERSAMPLING * lag + OVERSAMPLING - 1 - row]
            shaped = amp.shaped[row, LAGS - lag : LAGS - lag + QUANTUM]
            for frame in range(QUANTUM):
                out[frame] += tap * shaped[frame]
    gain, tone = amp.gain, amp.tone
    if amp.wanted_drive != 0.0:  # else it is switched off: as it was
        amp.drive = amp.wanted_drive
        amp.gain = amp.wanted_gain
        amp.tone = amp.wanted_tone
    gain_to, tone_to = amp.gain, amp.tone
    blocks = 1 - math.exp(-2 * math.pi * BLOCKING_HZ / mixer.rate_hz)
    follows = 1 - math.exp(-2 * math.pi * PIVOT_HZ / mixer.rate_hz)
    mean, low = amp.mean, amp.low_out
    for frame in range(QUANTUM):
        way = (frame + 1) / QUANTUM
        mean += blocks * (out[frame] - mean)
        value = (out[frame] - mean) * (gain + way * (gain_to - gain))
        low += follows * (value - low)
        high = tone + way * (tone_to - tone)
        value = low / high + (value - low) * high
        wet = share + way * (share_to - share)
        for side in range(2):
            dry = mix[frame, side]
            mix[frame, side] = value if wet == 1.0 else dry + wet * (value - dry)
    amp.mean, amp.low_out = mean, low if abs(low) >= SMALLEST else 0.0
