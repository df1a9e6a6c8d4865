"""Bodies of the user's own: taken in whole, found by name, heard, and left out when they are gone."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import soundfile

from app.audio.impulse_file import ImpulseError
from app.instrument.bodies import (
    body_digest,
    body_names,
    body_titles,
    install_body,
    own_bodies,
    own_impulse,
)
from app.instrument.effects import body_curves, body_problem, effects_of
from app.instrument.offline import render_note
from app.patches.patch import Body, Patch
from engine.effects import BODIES
from engine.presets import Preset

RATE_HZ = 48_000
LATE_FRAMES = 480


@pytest.fixture(autouse=True)
def own_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("LEARNED_STRINGS_PRESETS", str(tmp_path / "own"))


def late(path: Path, frames: int = LATE_FRAMES) -> Path:
    """A body that delays nearly all of its sound; it begins at once, or the delay would be left out."""
    samples = np.zeros(frames + 1)
    samples[[0, -1]] = 0.0031, 0.3
    soundfile.write(path, samples, RATE_HZ, "FLOAT" if path.suffix.lower() == ".wav" else "PCM_24")
    return path


def on(patch: Patch, name: str, mix: float = 1.0) -> Patch:
    return patch.model_copy(update={"body": Body(name=name, mix=mix)})


def test_a_file_becomes_a_body_whole_and_by_a_safe_name(tmp_path: Path) -> None:
    assert body_names() == list(BODIES)
    file = late(tmp_path / "My Cello: body (near).WAV")
    name = install_body(file)
    assert name == "my_cello_body_near"
    (copy,) = own_bodies().iterdir()
    assert copy.name == f"{name}.wav" and copy.read_bytes() == file.read_bytes()
    assert body_names() == [*BODIES, name]
    assert own_impulse(name) is own_impulse(name)


def test_the_same_file_is_copied_once_and_a_taken_name_gets_a_number(tmp_path: Path) -> None:
    one, other = late(tmp_path / "guitar.wav"), late(tmp_path / "guitar.flac", 99)
    assert [install_body(file) for file in (one, one, other, one)] == ["guitar_2", "guitar_2", "guitar_3", "guitar_2"]
    assert body_names() == [*BODIES, "guitar_2", "guitar_3"]
    assert len(own_impulse("guitar_3").samples) == 100


def test_what_is_no_impulse_response_is_not_taken(tmp_path: Path) -> None:
    file = tmp_path / "words.wav"
    file.write_text("no sound")
    with pytest.raises(ImpulseError, match=r"words\.wav"):
        install_body(file)
    assert not own_bodies().exists()


def test_names_are_never_paths(tmp_path: Path) -> None:
    install_body(late(tmp_path / "here.wav"))
    late(own_bodies() / ".hidden.wav")
    late(own_bodies() / "guitar.wav")  # the engine's own is meant by this name
    assert body_names() == [*BODIES, "here"]
    for name in ("../here", str(tmp_path / "here"), "here.wav", ".hidden"):
        with pytest.raises(ImpulseError, match="is not here"):
            own_impulse(name)


def test_it_is_heard_in_a_file(patch: Patch, preset: Preset, tmp_path: Path) -> None:
    name = install_body(late(tmp_path / "late.wav"))
    dry, wet = (render_note(each, preset, 57, 90, 1.0, 0.2, RATE_HZ)[:, 0] for each in (patch, on(patch, name)))
    peak = np.abs(dry).max()
    assert np.abs(wet[:LATE_FRAMES]).max() < 0.011 * peak
    np.testing.assert_allclose(wet[LATE_FRAMES:], dry[:-LATE_FRAMES], atol=0.011 * peak)


def test_a_body_in_stereo_is_heard_so(patch: Patch, preset: Preset, tmp_path: Path) -> None:
    samples = np.zeros((200, 2))
    samples[[0, -1], [0, 1]] = 0.5
    soundfile.write(tmp_path / "wide.wav", samples, RATE_HZ, "FLOAT")
    sound = render_note(on(patch, install_body(tmp_path / "wide.wav")), preset, 57, 90, 1.0, 0.1, RATE_HZ)
    assert sound.shape[1] == 2
    np.testing.assert_allclose(sound[199:, 1], sound[:-199, 0], atol=1e-5)


def test_its_digest_is_that_of_its_file(tmp_path: Path) -> None:
    name = install_body(late(tmp_path / "late.wav"))
    first = body_digest(name)
    assert len(first) == 64 and body_digest("guitar") == body_digest("nothing") == ""
    late(own_bodies() / "late.wav", 7)
    assert body_digest(name) not in ("", first)


def test_the_digest_of_a_file_that_stays_is_computed_once(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    name = install_body(late(tmp_path / "late.wav"))
    first = body_digest(name)
    monkeypatch.setattr(Path, "read_bytes", lambda path: pytest.fail(f"{path} is read again"))
    assert body_digest(name) == first


def test_one_that_is_gone_is_reported_in_a_line_and_left_out(patch: Patch, preset: Preset, tmp_path: Path) -> None:
    name = install_body(late(tmp_path / "late.wav"))
    wooden = on(patch, name)
    assert body_problem(wooden) == "" and effects_of(wooden) is not None
    (own_bodies() / "late.wav").unlink()
    problem = body_problem(wooden)
    assert problem.startswith("test is played without its body: the body late is not here")
    assert problem.isprintable()
    assert effects_of(wooden) is None and body_curves(wooden) is None
    dry, left_out = (render_note(each, preset, 57, 90, 1.0, 0.05, RATE_HZ) for each in (patch, wooden))
    np.testing.assert_array_equal(left_out, dry)
    assert body_problem(on(patch, name, mix=0.0)) == ""  # it would not be heard


def test_one_that_was_damaged_is_reported_with_its_file(patch: Patch, tmp_path: Path) -> None:
    name = install_body(late(tmp_path / "late.wav"))
    (own_bodies() / "late.wav").write_text("no sound any more")
    assert str(own_bodies() / "late.wav") in body_problem(on(patch, name))
    assert effects_of(on(patch, name)) is None


def test_every_body_has_a_title_in_words(tmp_path: Path) -> None:
    install_body(late(tmp_path / "here.wav"))
    titles = body_titles()
    assert titles[0] == ("guitar", "Guitar") and titles[-1] == ("here", "here")
    assert [name for name, _ in titles[:-1]] == list(BODIES)
    assert len({title for _, title in titles}) == len(titles)
