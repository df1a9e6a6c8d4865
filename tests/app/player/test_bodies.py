"""Bodies of the user's own: taken in whole, found by name, heard, and left out when they are gone."""

import hashlib
from pathlib import Path

import numpy as np
import pytest
import soundfile

from app.audio.impulse_file import ImpulseError
from app.instruments.instrument import BodyChoice, Instrument
from app.player.bodies import body_digest, body_names, body_titles, install_body, own_bodies, own_impulse
from app.player.effects import body_curves, body_problem, effects_of
from app.player.offline import render_note
from engine.effects import BODIES
from tests.app.player.stage import PRESET, RATE_HZ

LATE_FRAMES = 480


@pytest.fixture(autouse=True)
def own_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("LEARNED_STRINGS_PRESETS", str(tmp_path / "own"))


def late(path: Path, frames: int = LATE_FRAMES) -> Path:
    """A body that delays nearly all of its sound; it begins at once, or the delay would be left out."""
    samples = np.zeros((frames + 1, 2))
    samples[0] = 0.0031
    samples[-1] = 0.3
    soundfile.write(path, samples, RATE_HZ, "FLOAT" if path.suffix.lower() == ".wav" else "PCM_24")
    return path


def on(instrument: Instrument, name: str, mix: float = 1.0) -> Instrument:
    return instrument.model_copy(update={"body": BodyChoice(name=name, mix=mix)})


def test_a_file_becomes_a_body_whole_once_and_by_a_safe_name(tmp_path):
    assert body_names() == list(BODIES)
    file = late(tmp_path / "My Cello: body (near).WAV")
    name = install_body(file)
    (copy,) = own_bodies().iterdir()
    assert body_digest(name) == hashlib.sha256(file.read_bytes()).hexdigest() and body_digest("guitar") == ""
    assert copy.name == "my_cello_body_near.wav" == f"{name}.wav" and copy.read_bytes() == file.read_bytes()
    one, other = late(tmp_path / "guitar.wav", 77), late(tmp_path / "guitar.flac", 99)
    assert [install_body(file) for file in (one, one, other, one)] == ["guitar_2", "guitar_2", "guitar_3", "guitar_2"]
    assert body_names() == [*BODIES, "guitar_2", "guitar_3", name] and len(own_impulse("guitar_3").samples) == 100
    titles = dict(body_titles())
    assert titles["guitar"] == "Guitar" and titles[name] == name
    assert list(titles) == body_names() and len(set(titles.values())) == len(titles)


def test_names_are_never_paths_and_what_is_no_impulse_response_is_not_taken(tmp_path):
    file = tmp_path / "words.wav"
    file.write_text("no sound")
    with pytest.raises(ImpulseError, match=r"words\.wav"):
        install_body(file)
    assert not own_bodies().exists()
    install_body(late(tmp_path / "here.wav"))
    late(own_bodies() / ".hidden.wav")
    late(own_bodies() / "guitar.wav")  # the engine's own is meant by this name
    assert body_names() == [*BODIES, "here"]
    for name in ("../here", str(tmp_path / "here"), "here.wav", ".hidden"):
        with pytest.raises(ImpulseError, match="is not here"):
            own_impulse(name)


def test_it_is_heard_in_a_file_on_both_sides(instrument, tmp_path):
    wooden = on(instrument, install_body(late(tmp_path / "late.wav")))
    dry, wet = (render_note(each, PRESET, 57, 90, 1.0, 0.2, RATE_HZ) for each in (instrument, wooden))
    peak = np.abs(dry).max()
    assert wet.shape[1] == 2 and np.abs(wet[:LATE_FRAMES]).max() < 0.011 * peak
    for side in (0, 1):
        np.testing.assert_allclose(wet[LATE_FRAMES:, side], dry[:-LATE_FRAMES, 0], atol=0.011 * peak)


@pytest.mark.parametrize(
    ("damaged", "reported"),
    [(False, "test is played without its body: the body late is not here"), (True, "late.wav")],
)
def test_one_that_is_gone_is_reported_in_a_line_and_left_out(instrument, tmp_path, damaged, reported):
    wooden, file = on(instrument, install_body(late(tmp_path / "late.wav"))), own_bodies() / "late.wav"
    assert body_problem(wooden) == "" and effects_of(wooden) is not None
    file.unlink()
    if damaged:
        file.write_text("no sound any more")
    assert reported in body_problem(wooden) and body_problem(wooden).isprintable()
    assert effects_of(wooden) is None and body_curves(wooden) is None
    dry, left_out = (render_note(each, PRESET, 57, 90, 1.0, 0.05, RATE_HZ) for each in (instrument, wooden))
    np.testing.assert_array_equal(left_out, dry)
    assert body_problem(on(instrument, "late", mix=0.0)) == ""  # it would not be heard
