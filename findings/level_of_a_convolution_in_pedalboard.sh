#!/usr/bin/env bash
# The level of an impulse response in pedalboard.Convolution, as bodies, cabinets and rooms of instruments use it.
#
# Guess, written before the run: its output is numpy.convolve(sound, response), to single precision. A response that
# is half as loud gives half the sound, and one that passes the sound as it is, a single sample of 1, changes nothing.
#
# Seen (Linux, x86-64): the shape is that of numpy.convolve to 1e-8 of full scale, the level is not. Every response is
# scaled to an energy of 1/64, whatever its own: through a single sample of 1, and of 0.5 as well, a sound comes out
# at 0.125 (-18 dB), and a body measured 40 dB softer is as loud as before. So measured responses of two bodies, or of
# two places in one room, lose the difference of level that was measured, and a mix of dry and wet is not what its
# number says. The balance of two channels stays.
#
# Needs python3 (3.11 or later) with venv, and a package index. Fails if a level below changes.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/pip" install --quiet --disable-pip-version-check pedalboard==0.9.26 numpy==2.4.6
"$folder/venv/bin/python" - <<'PY'
import numpy as np
import pedalboard

RATE_HZ = 48_000
generator = np.random.default_rng(0)
body = generator.standard_normal(4_000) * np.exp(-np.arange(4_000) / 500)
body /= np.sqrt(np.sum(body**2))
responses = {
    "one sample of 1": np.eye(1, 512)[0],
    "one sample of 0.5": 0.5 * np.eye(1, 512)[0],
    "a body of energy 1": body,
    "the same, 40 dB softer": 0.01 * body,
}
sound = np.zeros(RATE_HZ // 4, np.float32)
sound[1_000:3_000] = 0.5 * generator.standard_normal(2_000)


def convolved(response):
    effect = pedalboard.Convolution(np.asarray(response, np.float32), 1.0, sample_rate=RATE_HZ)
    given = sound[None] if np.ndim(response) == 1 else np.stack([sound, sound])
    return effect.process(given, RATE_HZ).astype(np.float64)


print(f"pedalboard {pedalboard.__version__}, gain of its output over numpy.convolve:")
for name, response in responses.items():
    expected, found = np.convolve(sound, response)[: len(sound)], convolved(response)[0]
    gain = float(found @ expected / (expected @ expected))
    energy = float(np.sum(response**2)) * gain**2
    left = float(np.abs(found - gain * expected).max())
    print(f"  {name:<24} {gain:9.4f}   energy of the response as heard 1/{1 / energy:.2f}, left {left:.0e}")
    assert left < 1e-5, "it is no convolution with the response"
    assert abs(energy * 64 - 1) < 1e-3, "the response is heard at another level than 1/64 of energy"

left, right = (np.sqrt(np.mean(channel**2)) for channel in convolved(np.stack([body, 0.25 * body])))
print(f"  two channels, the second a quarter: {left / right:.3f} to 1")
assert abs(left / right - 4) < 1e-3, "the balance of two channels has changed"
PY
