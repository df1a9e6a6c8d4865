"""The sound of the Lab and of its exports by default, which is the one that `render` writes.

No instrument has any part in it, whichever was played before.
"""

from dataclasses import replace

import numpy as np
import pytest
import soundfile
from numpy.typing import NDArray
from PySide6.QtWidgets import QPushButton, QWidget

from app.analysis.abx.trials import AbxChoices
from app.audio.devices import AudioDevice
from app.audio.output import Output
from app.audio.sound import Sound
from app.export.choices import ExportChoices
from app.export.wav import WavSettings
from app.instruments.instrument import Instrument
from app.instruments.library import list_instruments
from app.player import events
from app.player.events import NoteOn, PluckAt
from app.playing.key_note import KeyNote
from app.playing.note import PluckVoices
from app.rendering.note_sound import NoteSound
from app.rendering.subject import StringOf
from app.shared.vocabulary import Source
from app.views.controls.number_box import CountBox
from app.views.dialogs.abx_dialog import AbxDialog
from app.views.file_places import FileChoices
from app.window.controller import LOOK_MS
from app.window.settings import load_settings
from engine.kernels import midi
from engine.kernels.constants import AHEAD, QUANTUM
from engine.kernels.voice_records import ATTACK_S
from engine.pluck import Pluck
from engine.presets import SHIPPED, load_preset, save_preset
from engine.values.ear import PICKUPS
from engine.voices import Mixer
from tests.app.sounds import render_sound
from tests.app.window.driver import CONTROL, KEY, Window, find, press

RATE_HZ = 48_000
SECONDS = 0.5  # of a pluck
HEARD_S, COMPARED_S = 0.3, 0.25  # the last part of a file fades out
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
SLOWEST = ("fgru", "frnn")
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
def held(opened, preset_folder) -> Window:
    """The Lab with a preset of each kind, the instruments, and an output that stands until frames are taken."""
    for preset in (load_preset(SHIPPED / f"{KINDS[kind]}.safetensors") for kind in SLOWEST):
        info = replace(preset.info, rate_hz=2000, modes=5)  # an eighth of the steps
        save_preset(preset_folder / preset.path.name, info, preset.model)
    made = opened(
        *(preset for kind, preset in KINDS.items() if kind not in SLOWEST),
        "studio_any_string",
        sound=lambda report: Sound(report, look_up=lambda *_: HeldOutput.device, open_output=HeldOutput),
        settings={"export": ExportChoices(until_decayed=False, seconds=HEARD_S, normalise=False, format="wav 32f")},
        face="lab",
        seconds=SECONDS,
        volume_db=0.0,
        level_match=False,
        amplitude_mm=2.0,
    )
    made.wait(lambda: made.controller.sound.status().device is not None)
    return made


def take(w: Window, seconds: float) -> Samples:
    """The next frames of the output, (frames, 2), in whole quanta: so what is played begins with the first."""
    mixer = w.controller.sound.mixer
    return mixer.render(round(seconds * RATE_HZ) // QUANTUM * QUANTUM).astype(np.float64)


def play_instrument(w: Window, instrument: Instrument) -> None:
    """Plays a key of an instrument, which rings on."""
    w.change(played=instrument)
    w.wait(lambda: w.keys.player is not None and w.keys.player.instrument.name == instrument.name)
    w.controller.inputs.play(NoteOn(sum(instrument.range) // 2, 100))
    take(w, 0.05)
    w.wait(lambda: isinstance(w.session.stage.note, KeyNote) and w.session.stage.known)


def fall_silent(w: Window) -> None:
    w.wait(lambda: w.performance.at_hand)
    assert any(np.abs(take(w, 0.1)).max() < 1e-8 for _ in range(100)), "it rings on"


def choose(w: Window, preset: str) -> None:
    """Chooses a preset while the instrument rings, and waits until that has ended."""
    w.change(preset=preset, amplitude_mm=2.0, position=0.3)
    fall_silent(w)


def heard(w: Window, slot: str) -> Samples:
    """The sound of a pluck from slot A or B, from its beginning on."""
    w.change(heard=slot)
    note = w.pluck()
    assert isinstance(note, PluckVoices)
    w.wait(lambda: not note.pending and all(each.finished for each in note.ahead))
    sound = take(w, HEARD_S)
    w.performance.stop()
    take(w, 0.05)
    return sound[AHEAD:]


def drawn(w: Window, source: Source) -> tuple[Samples, int]:
    """The signal that the Lab draws of the chosen pluck, of full scale, and the preset's own rate in Hz."""
    w.wait(lambda: w.performance.ready and w.performance.settled)
    shown = w.performance.take
    assert shown is not None
    return shown.listened.signals[source].read() / np.float64(shown.full_scale), shown.rate_hz


def rendered(w: Window, source: Source, rate_hz: int = RATE_HZ) -> Samples:
    """What the command `render` would write of the chosen pluck, (frames, channels)."""
    choices, preset = w.choices, w.controller.library.find(w.choices.preset).path
    subject = preset if choices.string is None else StringOf(preset, choices.string)
    sound = NoteSound(subject, choices.pluck, HEARD_S, choices.ear)
    return render_sound(sound, source, WavSettings(rate_hz=rate_hz)).reshape(round(HEARD_S * rate_hz), -1)


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


def assert_heard_as_rendered(w: Window, words: str) -> None:
    for slot, source in SOURCES.items():
        assert_same(heard(w, slot), rendered(w, source), f"{slot} {words}")


def blind(w: Window) -> dict[str, Samples]:
    """The sound of A and B in the listening test."""
    w.controller.listening_test()
    dialog = w.find(AbxDialog)
    w.wait(find(dialog, QPushButton, "Start the test").isEnabled)
    found = {}
    for slot, name in (("a", "▶  Hear A"), ("b", "Hear B")):
        press(dialog, name)
        found[slot] = take(w, HEARD_S)[AHEAD:]
        press(dialog, "Start the test")  # which ends what sounds
        take(w, 0.05)
    dialog.abandon()
    return found


def exported(w: Window) -> Samples:
    """What the export dialog writes as it opens."""
    w.controller.exports.open("note")
    dialog = w.controller.exports.dialog
    assert dialog is not None and dialog.note.through_words.text() == "None: the string alone, as it is heard"
    (path,) = dialog.note.paths().values()
    dialog.note.job().run(lambda *_: None)
    dialog.reject()
    return soundfile.read(path, always_2d=True)[0]


def test_what_is_heard_drawn_and_exported_is_what_is_rendered_whatever_was_played_before(held):
    """A model of each kind and its truth, in A, in B and blind, after all instruments with sympathy or an amplifier.

    By default files have that too.
    """
    for name, preset in zip([EFFECTIVE, *SYMPATHETIC], KINDS.values(), strict=False):
        play_instrument(held, PLAYED[name])
        choose(held, preset)
        expected = {slot: rendered(held, source) for slot, source in SOURCES.items()}
        for slot, source in SOURCES.items():
            assert_same(heard(held, slot), expected[slot], f"{preset}, {slot}, after {name}")
            signal, own_hz = drawn(held, source)
            attack = round(ATTACK_S * own_hz)  # a file fades in
            same = expected[slot] if own_hz == RATE_HZ else rendered(held, source, own_hz)
            assert_same(signal[attack:], same[attack:], f"{preset}, {slot}, drawn", rate_hz=own_hz)
            assert_same(exported(held), expected[slot], f"{preset}, {slot}, exported after {name}")
        for slot, sound in blind(held).items():
            assert_same(sound, expected[slot], f"{preset}, {slot} of the blind test, after {name}", False)
    for name in SYMPATHETIC[len(KINDS) - 1 :][:2]:
        play_instrument(held, PLAYED[name])
        choose(held, KINDS["koopman_var"])
        assert_same(heard(held, "a"), rendered(held, "model"), f"after {name}")


def test_pick_ups_late_keys_chords_and_single_strings_are_heard_as_they_are_rendered(held):
    """Also from the same points, where a model that is rendered ahead was heard through another pick-up before."""
    for kind in ("lru", "koopman_var"):
        choose(held, KINDS[kind])
        expected: dict[str, Samples] = {}
        for pickup in (*PICKUPS, *PICKUPS[::-1]):
            held.change(pickup_kind=pickup)
            expected[pickup] = rendered(held, "model") if pickup not in expected else expected[pickup]
            assert_same(heard(held, "a"), expected[pickup], f"{kind}, {pickup}")
    play_instrument(held, PLAYED["brass_strung_harp"])
    held.controller.inputs.play(NoteOn(60, 100))  # as in the milliseconds before the window's next look
    late = held.struck[-1]
    assert np.abs(take(held, 0.1)).max() > 1e-3
    held.change(preset=KINDS["koopman_var"], amplitude_mm=2.0, position=0.3)
    held.wait(lambda: not held.controller.sound.mixer.effects.rings)  # it ends with its room
    take(held, 0.1)
    held.wait(lambda: isinstance(late, KeyNote) and late.known)
    held.qtbot.wait(3 * LOOK_MS)
    assert held.choices.string is None and held.choices.pluck.position == 0.3, "a late key is not what is plucked"
    assert_heard_as_rendered(held, "right after a chord")
    play_instrument(held, PLAYED["tanpura_drone"])
    held.wait(lambda: held.choices.string is not None)
    held.session.play_string()  # of the key that was played last, without the instrument's level
    assert held.choices.string is not None and held.choices.single == "studio_any_string"
    held.performance.stop()
    fall_silent(held)
    assert_heard_as_rendered(held, "of a single string")


def test_the_lab_says_what_is_heard_and_how_far_it_was_trained(held, monkeypatch):
    """A match and an error are of what is chosen, not of the preset before."""
    label, outside, warned = held.window.through_label, held.window.outside_label, [("", False)]
    view = held.controller.string.view
    monkeypatch.setattr(view, "set_warning", lambda text, grave=True: warned.append((text, grave)))
    play_instrument(held, PLAYED["brass_strung_harp"])
    held.wait(lambda: outside.text().startswith("accurate, although decay time near 3 kHz"))
    assert outside.objectName() == "faint" and not warned[-1][1]
    for changes, words in (
        ({}, "heard through Brass-strung harp: body, room, sympathetic strings and level"),
        ({"b": "difference", "heard": "b"}, "heard through Brass-strung harp without amplifier, body and room"),
        ({"b": f"preset:{KINDS['s5']}"}, "keys are heard through Brass-strung harp, a string plucked by hand alone"),
    ):
        held.change(**changes)
        assert label.text() == words
    held.change(heard="a", preset=KINDS["lru"], shape="rounded", position=0.1, level_match=True)
    assert not label.text() and not label.isVisible()
    assert not warned[-1][1], "not measured yet"
    held.wait(lambda: warned[-1][1])
    assert warned[-1][0].startswith("inaccurate: ")
    held.pluck()
    held.wait(lambda: held.performance.match is not None)
    held.change(position=0.45)
    assert held.performance.match is None


@pytest.fixture
def paired(opened, speakers, tmp_path, monkeypatch) -> Window:
    """A window whose pluck is rendered, with a device that makes no sound."""
    monkeypatch.setattr("app.views.dialogs.abx_dialog.default_folder", lambda: tmp_path / "records")
    made = opened(sound=speakers, settings={"abx": AbxChoices(trials=2), "files": FileChoices()}, volume_db=-6)
    made.wait_for_take()
    return made


def open_test(w: Window) -> AbxDialog:
    """The dialog, once its sounds are rendered."""
    w.window.activateWindow()
    w.wait(w.window.isActiveWindow)
    w.key(KEY.Key_T, CONTROL)
    dialog = next(each for each in w.window.findChildren(AbxDialog) if each.isVisible())
    w.wait(find(dialog, QPushButton, "Start the test").isEnabled)
    return dialog


def sounds(w: Window) -> bool:
    """Return True if the mixer has a voice that is not silent."""
    return any(voice.sounding for voice in w.controller.sound.mixer.voices)


def test_the_test_has_the_sound_for_itself(paired, tmp_path, monkeypatch):
    """Keys are silent meanwhile; a pedal that is lifted then is up afterwards."""
    taken, handle = list[object](), paired.keys.handle
    monkeypatch.setattr(paired.keys, "handle", lambda event, *how: taken.append(event) or handle(event, *how))
    paired.pluck()
    paired.wait(lambda: sounds(paired))
    dialog = open_test(paired)
    assert dialog.isModal() and not paired.performance.playing
    paired.wait(lambda: not sounds(paired))
    before, count = paired.choices, len(paired.struck)
    del taken[:]
    released = [events.NoteOff(52), events.ControlChange(midi.SUSTAIN, 0)]
    for event in (PluckAt(Pluck(0.6, 8.0)), events.NoteOn(60, 90), *released):
        paired.controller.inputs.play(event)  # a MIDI keyboard
    paired.key(KEY.Key_Space)
    assert taken == released and paired.choices == before and len(paired.struck) == count and not sounds(paired)
    press(dialog, "▶  Hear B")
    paired.wait(lambda: sounds(paired))
    find(dialog, CountBox, "Number of trials").setValue(25)
    paired.key(KEY.Key_Escape, on=dialog)
    paired.wait(lambda: not sounds(paired))
    paired.pluck()
    paired.wait(lambda: paired.performance.position_s > 0.3)
    dialog = open_test(paired)
    press(dialog, "Start the test")
    trial = find(dialog, QWidget, "Trial")
    for key in (KEY.Key_X, KEY.Key_A, KEY.Key_B):
        paired.key(key, on=trial)
        paired.wait(lambda: sounds(paired))
    paired.key(KEY.Key_1, on=trial)
    paired.close()
    (path,) = (tmp_path / "records").iterdir()
    assert '"p_value": null' in path.read_text()
    assert load_settings(tmp_path / "settings.json")[0].abx.trials == 25
