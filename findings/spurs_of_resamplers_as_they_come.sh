#!/usr/bin/env bash
# Resamplers as they come, from 44.1 to 48 kHz: the spurs beside a tone, and its delay.
#
# Guess, written before the run: with their own settings all keep what is not in the sound 80 dB or more below it,
# scipy.signal.resample_poly at 80 dB, resampy at 100, soxr and samplerate's "sinc_best" at 140. A constant stays one
# to a millionth, and no tone is delayed, since each of them has a filter of linear phase and takes its delay off.
#
# Seen (Linux, x86-64): resample_poly, which is at hand wherever SciPy is, is the worst by far: 18 kHz at full scale
# brings 21.9 kHz at -54 dB, and a constant brings 3.9 kHz at -67 dB, for the 160 phases of its filter do not sum up
# alike. That is 40 dB above the dither of 16 bits. "sinc_fastest" of samplerate is cleaner than that by more than 40
# dB, but takes 4.3 dB from 18 kHz. resampy reaches what soxr does. pedalboard's StreamResampler has no whole delay
# left, but sounds come a third of a frame early (7 µs): nothing alone, yet beside the same sound, resampled
# otherwise, the difference at 10 kHz is only 7 dB below it.
#
# Needs python3 (3.11 or later) with venv, and a package index. Fails if a figure below changes.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/pip" install --quiet --disable-pip-version-check scipy==1.17.1 numpy==2.4.6 soxr==1.1.0 \
    samplerate==0.2.4 resampy==0.4.3 pedalboard==0.9.26
"$folder/venv/bin/python" - <<'PY'
from importlib.metadata import version

import numpy as np
import resampy
import samplerate
import soxr
from pedalboard.io import StreamResampler
from scipy import signal

FROM_HZ, TO_HZ = 44_100, 48_000
TONES_HZ = (0, 1_000, 10_000, 18_000)


def in_a_stream(sound):
    stream = StreamResampler(FROM_HZ, TO_HZ, 1)
    return np.concatenate([stream.process(sound[None].astype(np.float32)), stream.process(None)], axis=1)[0]


RESAMPLERS = {
    "scipy.signal.resample_poly": lambda sound: signal.resample_poly(sound, 160, 147),
    "soxr.resample": lambda sound: soxr.resample(sound, FROM_HZ, TO_HZ),
    "samplerate, sinc_best": lambda sound: samplerate.resample(sound, TO_HZ / FROM_HZ, "sinc_best"),
    "samplerate, sinc_fastest": lambda sound: samplerate.resample(sound, TO_HZ / FROM_HZ, "sinc_fastest"),
    "resampy.resample": lambda sound: resampy.resample(sound, FROM_HZ, TO_HZ),
    "pedalboard StreamResampler": in_a_stream,
}


def measured(resample, hz):
    """Level in dB, the strongest spur in dB and Hz, and the delay in frames, of the middle second of two."""
    sound = np.cos(2 * np.pi * hz * np.arange(2 * FROM_HZ) / FROM_HZ)
    middle = slice(TO_HZ // 2, TO_HZ // 2 + TO_HZ)
    found = np.asarray(resample(sound), np.float64)[middle]
    window = signal.windows.blackmanharris(TO_HZ)
    spectrum = 2 * np.abs(np.fft.rfft(found * window)) / window.sum()
    level = float(spectrum[hz]) if hz else float(spectrum[0]) / 2
    beside = spectrum.copy()
    beside[max(0, hz - 8) : hz + 9] = 0
    spur = int(beside.argmax())
    turns = np.exp(-2j * np.pi * hz * np.arange(middle.start, middle.stop) / TO_HZ)
    delay = -float(np.angle(np.sum(found * turns))) / (2 * np.pi * hz) * TO_HZ if hz else 0.0
    return 20 * np.log10(level), 20 * np.log10(beside[spur] / level), spur, delay


names = ("scipy", "soxr", "samplerate", "resampy", "pedalboard")
print(", ".join(f"{name} {version(name)}" for name in names) + "; tones at full scale, in Hz:")
found = {}
for name, resample in RESAMPLERS.items():
    for hz in TONES_HZ:
        level, spur_db, spur_hz, delay = found[name, hz] = measured(resample, hz)
        spur = f"spur {spur_db:6.1f} dB at {spur_hz:>6}"
        print(f"  {name:<27} {hz:>6}: {level:+7.3f} dB, {spur}, {delay:+.3f} frames late")

worst = {name: max(found[name, hz][1] for hz in TONES_HZ) for name in RESAMPLERS}
poly = "scipy.signal.resample_poly"
assert -60 < worst[poly] < -50 and -72 < found[poly, 0][1] < -62, "resample_poly has other spurs"
assert all(worst[name] < worst[poly] - 35 for name in RESAMPLERS if name != poly), "another one is as bad"
assert worst["resampy.resample"] < -130 and worst["soxr.resample"] < -130, "resampy or soxr is worse"
assert found["samplerate, sinc_fastest", 18_000][0] < -4, "sinc_fastest keeps 18 kHz"
late = {name: found[name, 1_000][3] for name in RESAMPLERS}
assert -0.4 < late.pop("pedalboard StreamResampler") < -0.3, "pedalboard is early by another part of a frame"
assert all(abs(each) < 1e-3 for each in late.values()), "another one is late or early"
PY
