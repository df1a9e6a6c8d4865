#!/usr/bin/env bash
# Frames after a seek in compressed sounds, as samplers and players read them through libsndfile.
#
# Guess, written before the run: Ogg Vorbis and MP3 give the same samples after a seek as when they are read from the
# beginning, to the bit, since both formats say how much must be decoded before. Opus, whose decoder carries a state
# on and on, differs by a thousandth until 80 ms have been decoded.
#
# Seen (Linux, x86-64, libsndfile 1.2.2 as soundfile ships it): the other way round. Opus is the same, within single
# precision. After a seek into the last page of an Ogg Vorbis file all samples come from hundreds of frames later, and
# stay so up to the end, although `tell` counts from the frame that was asked for. Pages hold a number of packets, so
# the softer and simpler a sound ends, the longer is its last page: here 0.5 s of noise, and 2.5 s of one that falls
# fast. It would fit that positions are counted back from the end of the last page, which is not the end of its last
# packet: an encoder cuts that off at the true length. MP3 is in its place, but of two seeks in three up to 70 ms are
# wrong, as wrong as another sound: frames before the seek may hold bits of those behind it (the bit reservoir). So a
# loop point, a stream from the middle, and a test of a preview must be made from whole, decoded sounds.
#
# Needs python3 (3.11 or later) with venv, and a package index. Fails if one of the three behaves otherwise.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/pip" install --quiet --disable-pip-version-check soundfile==0.14.0 numpy==2.4.6 scipy==1.17.1
"$folder/venv/bin/python" - <<'PY'
import io

import numpy as np
import soundfile
from scipy import signal

RATE_HZ, FRAMES, READ = 48_000, 288_000, 6_000
CONTAINERS = {"VORBIS": "OGG", "OPUS": "OGG", "MPEG_LAYER_III": "MP3"}
PLACES = np.linspace(500, FRAMES - 8_000, 70).astype(int).tolist()


def falling_noise(highest_hz, falls_per_s):
    noise = np.random.default_rng(0).standard_normal(FRAMES)
    sections = signal.butter(4, highest_hz, fs=RATE_HZ, output="sos")
    sound = signal.sosfilt(sections, noise) * np.exp(-falls_per_s * np.arange(FRAMES) / RATE_HZ)
    return 0.5 * sound / np.abs(sound).max()


def lag_of(whole, part, place):
    """How many frames later than at `place` a part of the whole begins: where they are most alike."""
    alike = signal.correlate(whole, part, "valid")
    powers = np.maximum(signal.correlate(whole**2, np.ones(len(part)), "valid"), 1e-14)
    return int(np.argmax(alike / np.sqrt(powers))) - place


def seeks(sound, kind):
    """The places with other samples after a seek, their lags, the last other sample, and the largest difference."""
    file = io.BytesIO()
    soundfile.write(file, sound, RATE_HZ, format=CONTAINERS[kind], subtype=kind)
    file.seek(0)
    whole, _ = soundfile.read(file)
    others, lags, last, largest = [], set(), 0, 0.0
    for place in PLACES:
        file.seek(0)
        with soundfile.SoundFile(file) as opened:
            opened.seek(place)
            part = opened.read(READ)
            assert opened.tell() == place + READ
        apart = np.abs(part - whole[place : place + READ]) / np.abs(whole[place : place + READ]).max()
        if apart.max() > 1e-4:
            others.append(place)
            half = READ // 2
            lags.add(lag_of(whole, part[half:], place + half))
            last, largest = max(last, int(np.flatnonzero(apart > 1e-4)[-1])), max(largest, float(apart.max()))
    return others, lags, last, largest


print(f"soundfile {soundfile.__version__}, {soundfile.__libsndfile_version__}, {len(PLACES)} seeks a file:")
found = {}
sounds = {"noise": falling_noise(1_500, 1.0), "noise that falls fast": falling_noise(400, 2.0)}
for name, kind in (*((name, kind) for name in sounds for kind in ("VORBIS", "OPUS")), ("noise", "MPEG_LAYER_III")):
    others, lags, last, largest = found[name, kind] = seeks(sounds[name], kind)
    words = "the same"
    if others:
        words = f"{len(others)} others, from frame {others[0]} on, up to {largest:.1f} of the peak there, "
        words += f"{lags} frames late, the last other sample {last}"
    print(f"  {name:<22} {kind:<15} {words}")

assert not found["noise", "OPUS"][0] and not found["noise that falls fast", "OPUS"][0], "Opus differs after a seek"
for name, first in (("noise", 255_000), ("noise that falls fast", 165_000)):
    others, lags, last, _ = found[name, "VORBIS"]
    assert others == PLACES[-len(others) :] and others[0] > first, "Vorbis differs elsewhere than in its last page"
    assert len(lags) == 1 and min(lags) > 100 and last == READ - 1, "Vorbis is no longer late by one number of frames"
others, lags, last, largest = found["noise", "MPEG_LAYER_III"]
assert len(others) > len(PLACES) // 2 and lags == {0} and 1_000 < last < READ // 2 + 1_000, "MP3 differs otherwise"
PY
