#!/usr/bin/env bash
# Sample rates of FLAC that libsndfile reads and does not write: sounds of a string rendered at its own, odd rate.
#
# Guess, written before the run: libsndfile writes FLAC at any whole rate up to 655350 Hz, since the head of the stream
# has 20 bits for it (RFC 9639, section 8.2), and FFmpeg does too; each reads what the other wrote.
#
# Seen (Linux, x86-64, libsndfile 1.2.2 as soundfile ships it, FFmpeg 8 as PyAV ships it): libsndfile writes whole rates
# up to 65535 Hz, above them multiples of 10 Hz alone. Frames of FLAC may state the rate in Hz by 16 bits, or in tens of
# Hz; a third way, to look in the head of the stream, is outside the streamable subset, which libFLAC keeps to
# unless told otherwise. It seems that libsndfile does not tell it. The error speaks of the *decoder*, while a file is
# written. FFmpeg writes these rates, and libsndfile reads its files, sample by sample as they were. So a program that
# converts WAV to FLAC through libsndfile must check the rate itself, and name it, before a long rendering.
#
# Needs python3 (3.11 or later) with venv, and a package index. Fails if one of the two behaves otherwise.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/pip" install --quiet --disable-pip-version-check soundfile==0.14.0 av==16.0.1 numpy==2.4.6
cd "$folder"
venv/bin/python - <<'PY'
import av
import numpy as np
import soundfile

WRITTEN, REFUSED = (44_101, 65_535, 88_200, 88_210, 655_350), (65_537, 88_201, 192_001)
SOUND = np.random.default_rng(0).integers(-9_000, 9_000, 20_000).astype(np.int16)


def by_libsndfile(rate_hz):
    """The words of the error; "" for a file that is read again as it was written."""
    try:
        soundfile.write("a.flac", SOUND, rate_hz)
    except soundfile.LibsndfileError as error:
        return str(error)
    found, found_hz = soundfile.read("a.flac", dtype="int16")
    assert found_hz == rate_hz and np.array_equal(found, SOUND)
    return ""


def by_ffmpeg(rate_hz):
    """The words of the error; "" for a file that libsndfile reads as it was written."""
    with av.open("b.flac", "w") as file:
        stream = file.add_stream("flac", rate=rate_hz, layout="mono", format="s16")
        frame = av.AudioFrame.from_ndarray(SOUND[None], format="s16", layout="mono")
        frame.sample_rate = rate_hz
        for packet in (*stream.encode(frame), *stream.encode(None)):
            file.mux(packet)
    found, found_hz = soundfile.read("b.flac", dtype="int16")
    assert found_hz == rate_hz and np.array_equal(found, SOUND)
    return ""


print(f"soundfile {soundfile.__version__}, {soundfile.__libsndfile_version__}; PyAV {av.__version__}:")
for rate_hz in WRITTEN + REFUSED:
    words, others = by_libsndfile(rate_hz), by_ffmpeg(rate_hz)
    print(f"  {rate_hz:>7} Hz  libsndfile: {words or 'written':<62} FFmpeg: {others or 'written, read by libsndfile'}")
    assert bool(words) == (rate_hz in REFUSED), "libsndfile writes other rates"
    assert "decoder" in words or not words, "the error has other words"
PY
