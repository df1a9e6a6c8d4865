#!/usr/bin/env bash
# Attenuation in a SoundFont 2, by a generator and by a modulator, in FluidSynth and TinySoundFont.
#
# Guess, written before the run: a generator initialAttenuation of 100 cB lowers a zone by 4 dB in FluidSynth, which
# multiplies it by 0.4 as the hardware of the format's authors did, and by 10 dB in TinySoundFont, as the format says.
# A modulator with the same destination is not multiplied, and counts in both: 100 cB are 10 dB.
#
# Seen (FluidSynth 2.3.1 of Debian 12, TinySoundFont 0.3.7 of PyPI): FluidSynth as guessed; 400 cB, in a straight line
# of velocity, are 20 dB at velocity 64. TinySoundFont has no modulators: a zone that replaces the format's own curve
# of velocity is heard with another, amplitude in proportion to velocity, so that velocity 64 lies 5.9 dB below 127
# where the file asks for 0, for 20, and, by the format's own curve, for 11.9. One file is thus heard with two levels
# and two curves, and only a zone of one velocity without that generator is alike in both. A writer that must be right
# everywhere puts levels into samples.
#
# Needs python3 (3.11 or later) with venv, a package index, and FluidSynth (apt-get install fluidsynth). Fails if a
# level below changes.
set -euo pipefail
command -v fluidsynth >/dev/null || { echo "install fluidsynth first: apt-get install fluidsynth"; exit 2; }
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/pip" install --quiet --disable-pip-version-check numpy==2.4.6
"$folder/venv/bin/pip" install --quiet --disable-pip-version-check --no-deps tinysoundfont==0.3.7  # no sound card
fluidsynth --version | head -1
cd "$folder"
venv/bin/python - <<'PY'
import struct
import subprocess
from importlib.metadata import version

import numpy as np
import tinysoundfont

RATE_HZ, KEY = 44_100, 69
ATTENUATION, LOOPED, SAMPLE, INSTRUMENT = 48, 54, 53, 41  # generators
CURVE, FALLING = 0x0502, 0x0102  # velocity from 127 down to 0, as the format's own curve, and in a straight line
OWN_CURVE_OFF = (CURVE, ATTENUATION, 0, 0, 0)
FILTER_OFF = (FALLING, 8, 0, 0, 0)  # the format's own change of a filter by velocity


def chunk(name, data):
    return name + struct.pack("<I", len(data)) + data + bytes(len(data) % 2)


def soundfont(generators, modulators):
    """One looped sine of 441 Hz on all keys."""
    frames = RATE_HZ
    sine = (8_000 * np.sin(2 * np.pi * 441 * np.arange(frames) / RATE_HZ)).astype("<i2").tobytes() + bytes(92)
    rows = [*generators, (LOOPED, 1), (SAMPLE, 0)]
    head = struct.pack("<20sHHHIII", b"sine", 0, 0, 0, 0, 0, 0) + struct.pack("<20sHHHIII", b"EOP", 0, 0, 1, 0, 0, 0)
    sample = struct.pack("<20sIIIIIBbHH", b"sine", 0, frames, 400, 40_400, RATE_HZ, KEY, 0, 0, 1)
    tables = (
        (b"phdr", head),
        (b"pbag", struct.pack("<4H", 0, 0, 1, 0)),
        (b"pmod", bytes(10)),
        (b"pgen", struct.pack("<HH", INSTRUMENT, 0) + bytes(4)),
        (b"inst", struct.pack("<20sH20sH", b"sine", 0, b"EOI", 1)),
        (b"ibag", struct.pack("<4H", 0, 0, len(rows), len(modulators))),
        (b"imod", b"".join(struct.pack("<HHhHH", *each) for each in modulators) + bytes(10)),
        (b"igen", b"".join(struct.pack("<HH", *each) for each in rows) + bytes(4)),
        (b"shdr", sample + struct.pack("<20s26x", b"EOS")),
    )
    info = chunk(b"ifil", struct.pack("<HH", 2, 1)) + chunk(b"isng", b"EMU8000\0") + chunk(b"INAM", b"sine\0\0")
    data = b"".join(chunk(*table) for table in tables)
    lists = (b"INFO" + info, b"sdta" + chunk(b"smpl", sine), b"pdta" + data)
    return chunk(b"RIFF", b"sfbk" + b"".join(chunk(b"LIST", each) for each in lists))


def level_db(sound):
    middle = sound.reshape(-1, 2)[RATE_HZ // 4 : RATE_HZ * 3 // 4].astype(np.float64)
    return 10 * np.log10(np.mean(middle**2))


def by_tinysoundfont(velocity):
    synth = tinysoundfont.Synth(samplerate=RATE_HZ)
    synth.program_select(0, synth.sfload("sine.sf2"), 0, 0)
    synth.noteon(0, KEY, velocity)
    return level_db(np.frombuffer(bytes(synth.generate(RATE_HZ)), np.float32))


def by_fluidsynth(velocity):
    track = bytes([0, 0x90, KEY, velocity, 0x8F, 0, 0x80, KEY, 0, 0, 0xFF, 0x2F, 0])  # held for two seconds
    with open("note.mid", "wb") as file:
        file.write(b"MThd" + struct.pack(">IHHH", 6, 0, 1, 480) + b"MTrk" + struct.pack(">I", len(track)) + track)
    command = f"fluidsynth -ni -R 0 -C 0 -r {RATE_HZ} -O float -T raw -F note.raw sine.sf2 note.mid"
    subprocess.run(command.split(), check=True, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    return level_db(np.fromfile("note.raw", "<f4"))


FILES = {
    "the format's own curve": ((), (FILTER_OFF,)),
    "curve off": ((), (OWN_CURVE_OFF, FILTER_OFF)),
    "curve off, generator 100 cB": (((ATTENUATION, 100),), (OWN_CURVE_OFF, FILTER_OFF)),
    "modulator 400 cB, straight": ((), (OWN_CURVE_OFF, FILTER_OFF, (FALLING, ATTENUATION, 400, 0, 0))),
}
print(f"TinySoundFont {version('tinysoundfont')}; dB re velocity 127 with the curve off:")
heard = {}
for name, parts in FILES.items():
    with open("sine.sf2", "wb") as file:
        file.write(soundfont(*parts))
    for synth in (by_fluidsynth, by_tinysoundfont):
        for velocity in (127, 64):
            heard[name, synth.__name__, velocity] = synth(velocity)
found = {key: level - heard["curve off", key[1], 127] for key, level in heard.items()}
for name in FILES:
    for synth in ("by_fluidsynth", "by_tinysoundfont"):
        hard, soft = found[name, synth, 127], found[name, synth, 64]
        print(f"  {name:<28} {synth:<17} velocity 127 {hard:6.2f}, 64 {soft:6.2f}")


def is_near(name, synth, velocity, level):
    return abs(found[name, synth, velocity] - level) < 0.35


generator, modulator = "curve off, generator 100 cB", "modulator 400 cB, straight"
assert is_near(generator, "by_fluidsynth", 127, -4), "FluidSynth's generator is not multiplied by 0.4"
assert is_near(generator, "by_tinysoundfont", 127, -10), "TinySoundFont's generator is not 10 dB"
assert is_near(modulator, "by_fluidsynth", 64, -20), "FluidSynth multiplies a modulator"
assert is_near("curve off", "by_fluidsynth", 64, 0), "FluidSynth does not take the curve out"
assert all(is_near(name, "by_tinysoundfont", 64, -5.95) for name in FILES if name != generator), "it has modulators"
PY
