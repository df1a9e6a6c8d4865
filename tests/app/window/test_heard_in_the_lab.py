"""The sound of the Lab and of its exports by default, which is the one that `render` writes.

No instrument has any part in it, whichever was played before.
"""

from __future__ import annotations

import shutil
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
import soundfile
from numpy.typing import NDArray
from PySide6.QtWidgets import QPushButton
from pytestqt.qtbot import QtBot

from app.audio.devices import AudioDevice
from app.audio.output import Output
from app.audio.sound import Sound
from app.export.choices import ExportChoices
from app.export.wav import WavSettings
from app.instruments.instrument import Instrument
from app.instruments.library import list_instruments
from app.player.events import NoteOn
from app.playing.key_note import KeyNote
from app.playing.note import PluckVoices
from app.rendering.note_sound import NoteSound
from app.rendering.subject import StringOf, path_of
from app.session.choices import Choices
from app.shared.vocabulary import Source
from app.views.dialogs.abx_dialog import AbxDialog
from app.window.controller import LOOK_MS, Controller
from app.window.main_window import MainWindow
from app.window.settings import Settings
from engine.kernels.constants import AHEAD, QUANTUM
from engine.kernels.voice_records import ATTACK_S
from engine.presets import SHIPPED
from engine.values.ear import PICKUPS
from engine.voices import Mixer
from tests.app.places import files_in
from tests.app.sounds import render_sound
from tests.app.window.driver import find, press

RATE_HZ = 48_000
SECONDS = 0.5  # of a pluck; the last part of it fades out
COMPARED_S = 0.25
LEVEL_DB, RESIDUAL_DB = 0.1, -60.0
KINDS = {
    "dmd": "nylon_linear_gaussian_16k_dmd",
    "koopman": "nylon_nonlinear_gaussian_16k_koopman",
    "koopman_var": "nylon_nonlinear_gaussian_4k_koopman_var",
    "koopman_integrated": "studio_nylon_b3",
    "koopman_tension": "studio_any_bass_a1",
    "lru": "nylon_nonlinear_gaussian_16k_lru",
    "s5": "nylon_nonlinear_gaussian_4k_s5",
    "fgru": "nylon_nonlinear_gaussian_16k_fgru_400",
    "frnn": "nylon_nonlinear_gaussian_16k_frnn_400",
}
SOURCES: dict[str, Source] = {"a": "model", "b": "truth"}
EFFECTIVE = "electric_guitar_bridge_pick_up"  # an amplifier, a cabinet and a room
PLAYED = {entry.path.stem: entry.instrument for entry in list_instruments()[0]}
SYMPATHETIC = [name for name, instrument in PLAYED.items() if instrument.sympathy_s_kg > 0]
Samples = NDArray[np.float64]


class HeldOutput(Output):
    """A device whose frames the test takes."""

    device = AudioDevice("Held", "Test API", RATE_HZ)

    def __init__(self, device: AudioDevice, buffer_s: float, mixer: Mixer) -> None:
        self.rate_hz, self._mixer = mixer.rate_hz, mixer

    def now_s(self) -> float:
        return self._mixer.seconds


@pytest.fixture
def lab(qtbot: QtBot, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Controller]:
    """The window with a preset of each kind, the instruments, and an output that stands until frames are taken."""
    folder = tmp_path / "presets"
    folder.mkdir()
    for name in (*KINDS.values(), "studio_any_string"):
        shutil.copy(SHIPPED / f"{name}.safetensors", folder)
    monkeypatch.setattr("app.presets.library.SHIPPED", folder)
    window = MainWindow()
    qtbot.addWidget(window)
    choices = Choices(seconds=SECONDS, face="lab", volume_db=0.0, level_match=False, amplitude_mm=2.0)
    exported = ExportChoices(until_decayed=False, seconds=SECONDS, normalise=False, format="wav 32f")
    settings = Settings(choices=choices, export=exported, files=files_in(tmp_path))
    device = HeldOutput.device
    make_sound = lambda report: Sound(report, look_up=lambda *_: device, open_output=HeldOutput)  # noqa: E731
    made = Controller(window, settings, tmp_path / "settings.json", make_sound)
    window.show()
    qtbot.waitUntil(lambda: made.sound.status().device is not None)
    yield made
    window.may_close = lambda: True
    window.close()


def take(lab: Controller, seconds: float) -> Samples:
    """The next frames of the output, (frames, 2), in whole quanta: so what is played begins with the first."""
    return lab.sound.mixer.render(round(seconds * RATE_HZ) // QUANTUM * QUANTUM).astype(np.float64)


def play_instrument(qtbot: QtBot, lab: Controller, instrument: Instrument) -> None:
    """Plays a key of an instrument, which rings on."""
    lab.session.update(played=instrument)
    keys = lab.performance.notes.keys
    qtbot.waitUntil(lambda: keys.player is not None and keys.player.instrument.name == instrument.name)
    lab.inputs.play(NoteOn(sum(instrument.range) // 2, 100))
    take(lab, 0.05)
    qtbot.waitUntil(lambda: isinstance(lab.session.stage.note, KeyNote) and lab.session.stage.known)


def choose(qtbot: QtBot, lab: Controller, preset: str) -> None:
    """Chooses a preset while the instrument rings, and waits until that has ended."""
    lab.session.update(preset=preset, amplitude_mm=2.0, position=0.3)
    qtbot.waitUntil(lambda: lab.performance.at_hand)
    for _ in range(100):
        if np.abs(take(lab, 0.1)).max() < 1e-8:
            return
    raise AssertionError("it rings on")


def heard(qtbot: QtBot, lab: Controller, slot: str) -> Samples:
    """The sound of a pluck from slot A or B, from its beginning on."""
    lab.session.update(heard=slot)
    lab.pluck()
    note = lab.performance.notes.latest
    assert isinstance(note, PluckVoices)
    qtbot.waitUntil(lambda: not note.pending and all(each.finished for each in note.ahead))
    sound = take(lab, SECONDS)
    lab.performance.stop()
    take(lab, 0.05)
    return sound[AHEAD:]


def drawn(qtbot: QtBot, lab: Controller, source: Source) -> tuple[Samples, int]:
    """The signal that the Lab draws of the chosen pluck, of full scale, and the preset's own rate in Hz."""
    qtbot.waitUntil(lambda: lab.performance.ready and lab.performance.settled)
    shown = lab.performance.take
    assert shown is not None
    return shown.listened.signals[source].read() / np.float64(shown.full_scale), shown.rate_hz


def rendered(lab: Controller, source: Source, rate_hz: int = RATE_HZ) -> Samples:
    """What the command `render` would write of the chosen pluck, (frames, channels)."""
    choices = lab.session.choices
    sound = NoteSound(SHIPPED / f"{choices.preset}.safetensors", choices.pluck, SECONDS, choices.ear)
    return render_sound(sound, source, WavSettings(rate_hz=rate_hz)).reshape(round(SECONDS * rate_hz), -1)


def assert_same(
    found: Samples, expected: Samples, words: str, gain_counts: bool = True, rate_hz: int = RATE_HZ
) -> None:
    """Level within 0.1 dB, and what is left of the difference after the best gain, below -60 dB."""
    frames = round(COMPARED_S * rate_hz)
    found, expected = (np.broadcast_to(each[:frames], (frames, 2)) for each in (found, expected))
    gain = float((found * expected).sum() / (expected * expected).sum())
    residual = np.sqrt(np.square(found - gain * expected).sum() / np.square(found).sum())
    assert 20 * np.log10(residual + 1e-12) <= RESIDUAL_DB, f"{words}: {20 * np.log10(residual):.1f} dB is left"
    level_db = 10 * np.log10(np.square(found).sum() / np.square(expected).sum())
    assert not gain_counts or abs(level_db) <= LEVEL_DB, f"{words}: {level_db:.2f} dB"


def blind(qtbot: QtBot, lab: Controller) -> dict[str, Samples]:
    """The sound of A and B in the listening test."""
    lab.listening_test()
    dialog = find(lab.window, AbxDialog)
    qtbot.waitUntil(find(dialog, QPushButton, "Start the test").isEnabled)
    found = {}
    for slot, name in (("a", "▶  Hear A"), ("b", "Hear B")):
        press(dialog, name)
        found[slot] = take(lab, 0.3)[AHEAD:]
        press(dialog, "Start the test")  # which ends what sounds
        take(lab, 0.05)
    dialog.abandon()
    return found


def exported(lab: Controller) -> Samples:
    """What the export dialog writes as it opens."""
    lab.exports.open("note")
    assert lab.exports.dialog is not None
    page = lab.exports.dialog.note
    assert page.through_words.text() == "None: the string alone, as it is heard"
    (path,) = page.paths().values()
    page.job().run(lambda *_: None)
    lab.exports.dialog.reject()
    return soundfile.read(path, always_2d=True)[0]


def test_what_is_heard_drawn_and_exported_is_what_is_rendered_whatever_was_played_before(
    qtbot: QtBot, lab: Controller
) -> None:
    """A model of each kind and its truth, in A, in B and blind, after all instruments with sympathy or an amplifier.

    By default files have that too; of the slowest kinds, which are rendered as others are, none is written here.
    """
    for name, (kind, preset) in zip([EFFECTIVE, *SYMPATHETIC], KINDS.items(), strict=False):
        play_instrument(qtbot, lab, PLAYED[name])
        choose(qtbot, lab, preset)
        expected = {slot: rendered(lab, source) for slot, source in SOURCES.items()}
        for slot, source in SOURCES.items():
            assert_same(heard(qtbot, lab, slot), expected[slot], f"{preset}, {slot}, after {name}")
            signal, own_hz = drawn(qtbot, lab, source)
            attack = round(ATTACK_S * own_hz)  # a file fades in
            same = rendered(lab, source, own_hz)
            assert_same(signal[attack:], same[attack:], f"{preset}, {slot}, drawn", rate_hz=own_hz)
            if kind not in ("fgru", "frnn"):
                assert_same(exported(lab), expected[slot], f"{preset}, {slot}, exported after {name}")
        for slot, sound in blind(qtbot, lab).items():
            assert_same(sound, expected[slot], f"{preset}, {slot} of the blind test, after {name}", False)
    for name in SYMPATHETIC[len(KINDS) - 1 :]:
        play_instrument(qtbot, lab, PLAYED[name])
        choose(qtbot, lab, KINDS["koopman_var"])
        for slot, source in SOURCES.items():
            assert_same(heard(qtbot, lab, slot), rendered(lab, source), f"{slot} after {name}")


@pytest.mark.parametrize("kind", ["lru", "koopman_var"])
def test_each_pick_up_is_heard_as_it_is_rendered(qtbot: QtBot, lab: Controller, kind: str) -> None:
    """Also from the same points, where a model that is rendered ahead was heard through another pick-up before."""
    lab.session.update(preset=KINDS[kind], amplitude_mm=2.0, position=0.3)
    qtbot.waitUntil(lambda: lab.performance.at_hand)
    for pickup in (*PICKUPS, *PICKUPS[::-1]):
        lab.session.update(pickup=pickup)
        assert_same(heard(qtbot, lab, "a"), rendered(lab, "model"), f"{kind}, {pickup}")


def test_a_key_that_is_reported_after_a_preset_was_chosen_is_not_what_is_plucked(
    qtbot: QtBot, lab: Controller
) -> None:
    """As in the milliseconds between the stroke and the window's next look, or while a song plays."""
    play_instrument(qtbot, lab, PLAYED["brass_strung_harp"])
    lab.inputs.play(NoteOn(60, 100))
    late = lab.performance.notes.latest
    lab.session.update(preset=KINDS["koopman_var"], amplitude_mm=2.0, position=0.3)
    take(lab, 0.1)
    qtbot.waitUntil(lambda: isinstance(late, KeyNote) and late.known)
    qtbot.wait(3 * LOOK_MS)
    assert lab.session.choices.string is None and lab.session.choices.position == 0.3
    choose(qtbot, lab, KINDS["koopman_var"])
    for slot, source in SOURCES.items():
        assert_same(heard(qtbot, lab, slot), rendered(lab, source), f"{slot} after a late key")


def test_a_string_of_the_instrument_that_is_plucked_by_itself_has_no_level_of_it(
    qtbot: QtBot, lab: Controller
) -> None:
    """The string of the key that was played last, as a single string."""
    play_instrument(qtbot, lab, PLAYED["tanpura_drone"])
    qtbot.waitUntil(lambda: lab.session.choices.string is not None)
    lab.session.play_string()
    string = lab.session.choices.string
    assert string is not None and lab.session.choices.single == "studio_any_string"
    lab.performance.stop()
    qtbot.waitUntil(lambda: lab.performance.at_hand)
    while np.abs(take(lab, 0.1)).max() > 1e-8:
        pass
    subject, choices = StringOf(SHIPPED / "studio_any_string.safetensors", string), lab.session.choices
    for slot, source in SOURCES.items():
        sound = NoteSound(subject, choices.pluck, SECONDS, choices.ear)
        expected = render_sound(sound, source, WavSettings(rate_hz=RATE_HZ)).reshape(round(SECONDS * RATE_HZ), -1)
        assert_same(heard(qtbot, lab, slot), expected, slot)


def test_the_level_match_shown_is_of_what_is_chosen(qtbot: QtBot, lab: Controller) -> None:
    """Not of the preset before, until the next pluck."""
    lab.session.update(level_match=True, preset=KINDS["lru"])
    qtbot.waitUntil(lambda: lab.performance.at_hand)
    lab.pluck()
    qtbot.waitUntil(lambda: lab.performance.match is not None)
    first = lab.performance.match
    lab.session.update(preset=KINDS["s5"])
    assert lab.performance.match is None
    lab.session.update(preset=KINDS["lru"])
    assert lab.performance.match == first
    lab.session.update(position=0.45)
    assert lab.performance.match is None


def test_an_instrument_that_rings_ends_where_a_preset_is_chosen(qtbot: QtBot, lab: Controller) -> None:
    """With its room; so a pluck right after a chord is heard by itself."""
    lab.session.update(preset=KINDS["koopman_var"])
    qtbot.waitUntil(lambda: lab.performance.at_hand)
    play_instrument(qtbot, lab, PLAYED["brass_strung_harp"])
    assert np.abs(take(lab, 0.1)).max() > 1e-3
    lab.session.update(preset=KINDS["koopman_var"], amplitude_mm=2.0, position=0.3)
    qtbot.waitUntil(lambda: not lab.sound.mixer.effects.rings)
    take(lab, 0.1)
    for slot, source in SOURCES.items():
        assert_same(heard(qtbot, lab, slot), rendered(lab, source), f"{slot} right after a chord")


def test_the_lab_names_the_instrument_that_keys_sound_through(qtbot: QtBot, lab: Controller) -> None:
    label = lab.window.through_label
    play_instrument(qtbot, lab, PLAYED["kora"])
    assert label.text() == "heard through Kora: body, room, sympathetic strings and level"
    lab.session.update(b="difference", heard="b")
    assert label.text() == "heard through Kora without amplifier, body and room"
    lab.session.update(b=f"preset:{KINDS['s5']}")
    assert label.text() == "keys are heard through Kora, a string plucked by hand alone"
    lab.session.update(preset=KINDS["lru"])
    assert not label.text() and not label.isVisible()


def test_a_key_is_exported_with_its_instrument_also_where_a_slot_holds_another_preset(
    qtbot: QtBot, lab: Controller
) -> None:
    """For keys sound through their instrument then too; a pluck by hand is the other preset's string alone."""
    lab.session.update(a=f"preset:{KINDS['koopman_var']}")
    play_instrument(qtbot, lab, PLAYED["kora"])
    lab.exports.open("note")
    assert lab.exports.dialog is not None
    page = lab.exports.dialog.note
    assert page.through_words.text() == "Kora with body, room, sympathetic strings and level, as it is heard"
    qtbot.waitUntil(lambda: lab.performance.at_hand)
    lab.pluck()
    qtbot.waitUntil(lambda: page.through_words.text() == "None: the string alone, as it is heard")
    assert path_of(page.job().sound.preset).stem == KINDS["koopman_var"]
    lab.exports.dialog.reject()


def test_a_pluck_outside_the_training_is_red_only_where_its_error_is_large(
    qtbot: QtBot, lab: Controller, monkeypatch: pytest.MonkeyPatch
) -> None:
    label, view, warned = lab.window.outside_label, lab.string.view, [("", False)]
    monkeypatch.setattr(view, "set_warning", lambda text, grave=True: warned.append((text, grave)))
    play_instrument(qtbot, lab, PLAYED["brass_strung_harp"])
    qtbot.waitUntil(lambda: label.text().startswith("accurate, although decay time near 3 kHz"))
    assert label.objectName() == "faint" and not warned[-1][1]
    lab.session.update(preset=KINDS["lru"], shape="rounded", position=0.1)
    assert not warned[-1][1], "not measured yet"
    qtbot.waitUntil(lambda: warned[-1][1])
    assert warned[-1][0].startswith("inaccurate: ")
