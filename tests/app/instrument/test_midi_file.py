from __future__ import annotations

from pathlib import Path

import mido
import pytest

from app.instrument.events import (
    KEYS,
    Bend,
    Controller,
    Event,
    NoteOff,
    NoteOn,
    PatchTurned,
    TimedEvent,
    bend_range,
    channels_in,
    release_all,
)
from app.instrument.midi_file import MidiFileError, Song, event_of, midi_bytes, read_midi, read_song
from app.patches.library import SHIPPED, read_patch
from app.patches.patch import Patch

PATCHES = {
    mode: read_patch(SHIPPED / "long_wire.json").model_copy(update={"mode": mode, "range": (0, 127)})
    for mode in ("mpe", "guitar")
}
PLAYED = [
    TimedEvent(0.0, NoteOn(60, 90, 2)),
    TimedEvent(0.25, Bend(-0.5, 2)),
    TimedEvent(0.5, Controller(64, 127, 2)),
    TimedEvent(0.75, Bend(1.0, 2)),
    TimedEvent(1.5, NoteOff(60, 2)),
]


def test_what_is_written_is_read_again(tmp_path: Path) -> None:
    file = tmp_path / "played.mid"
    file.write_bytes(midi_bytes(PLAYED))
    found = read_midi(file)
    assert [each.time_s for each in found] == pytest.approx([each.time_s for each in PLAYED], abs=1e-3)
    for one, other in zip(found, PLAYED, strict=True):
        if isinstance(other.event, Bend):
            assert isinstance(one.event, Bend)
            assert one.event.value == pytest.approx(other.event.value, abs=2e-4)
        else:
            assert one.event == other.event


def test_another_program_reads_it(tmp_path: Path) -> None:
    file = tmp_path / "played.mid"
    file.write_bytes(midi_bytes(PLAYED))
    read = mido.MidiFile(file)
    assert read.length == pytest.approx(1.5, abs=1e-3)
    assert [m.type for m in read.tracks[0]][1:3] == ["note_on", "pitchwheel"]


def test_tempo_and_tracks_are_followed(tmp_path: Path) -> None:
    file = mido.MidiFile(ticks_per_beat=480)
    first, second = mido.MidiTrack(), mido.MidiTrack()
    first.append(mido.MetaMessage("set_tempo", tempo=1_000_000))
    first.append(mido.MetaMessage("set_tempo", tempo=250_000, time=480))
    second.append(mido.Message("note_on", note=60, velocity=1, time=960))
    second.append(mido.Message("note_on", note=60, velocity=0, time=480))
    file.tracks.extend([first, second])
    file.save(tmp_path / "two.mid")
    assert read_midi(tmp_path / "two.mid") == [TimedEvent(1.25, NoteOn(60, 1)), TimedEvent(1.5, NoteOff(60))]


def test_a_patch_that_was_turned_is_no_midi(patch: Patch) -> None:
    assert midi_bytes([TimedEvent(0.0, PatchTurned(patch)), *PLAYED]) == midi_bytes(PLAYED)


def test_what_strings_do_not_answer_is_left_out() -> None:
    def event(kind: str, **facts: int) -> object:
        return event_of(mido.Message(kind, **facts).bytes())

    assert event("clock") is None
    assert event("program_change", program=3) is None
    assert event("polytouch", note=3, value=4) is None
    assert event("pitchwheel", pitch=-8192) == Bend(-1.0)
    assert event("pitchwheel", pitch=8191) == Bend(1.0)
    assert event("note_on", note=3, velocity=0, channel=4) == NoteOff(3, 4)
    assert event("control_change", control=121, value=127) == Controller(121, 0)  # other values are the program's own


@pytest.mark.parametrize(
    ("raw", "reported"),
    [
        (b"", "no MIDI file"),
        (b"RIFF....WAVE", "no MIDI file"),
        (midi_bytes(PLAYED)[:40], "no MIDI file"),
        (midi_bytes([]), "no note"),
        (b"MThd\0\0\0\6\0\0\0\1\0\0MTrk\0\0\0\4\0\xff\x2f\0", "no"),
        (midi_bytes(PLAYED)[:12] + b"\xd0\x28" + midi_bytes(PLAYED)[14:], "frames at a rate"),
        (midi_bytes(PLAYED)[:12] + b"\xe7\x00" + midi_bytes(PLAYED)[14:], "frames at a rate"),
        (midi_bytes(PLAYED)[:12] + b"\0\0" + midi_bytes(PLAYED)[14:], "division of 0"),
        (b"RIFF\x0c\0\0\0RMIDLIST\0\0\0\0", "no chunk of data"),
        (midi_bytes([TimedEvent(4000.0, NoteOn(1, 1))]), "an hour"),
    ],
)
def test_a_file_that_cannot_be_played_is_named(tmp_path: Path, raw: bytes, reported: str) -> None:
    file = tmp_path / "bad.mid"
    file.write_bytes(raw)
    with pytest.raises(MidiFileError, match=reported) as caught:
        read_midi(file)
    assert str(file) in str(caught.value)
    assert "\n" not in str(caught.value)


def test_a_huge_file_is_not_read(tmp_path: Path) -> None:
    file = tmp_path / "huge.mid"
    with file.open("wb") as out:
        out.truncate(100 * 2**20)
    with pytest.raises(MidiFileError, match="4 MiB"):
        read_midi(file)


def test_no_file_says_so(tmp_path: Path) -> None:
    with pytest.raises(MidiFileError, match="cannot be read"):
        read_midi(tmp_path / "none.mid")


# The range of bends


def written(folder: Path, timed: list[TimedEvent], patch: Patch) -> list[Event]:
    file = folder / "ranges.mid"
    file.write_bytes(midi_bytes(timed, patch))
    return [each.event for each in read_midi(file)]


def test_a_recording_has_the_range_of_bends_of_each_channel(tmp_path: Path) -> None:
    patch = PATCHES["guitar"].model_copy(update={"mode": "poly", "bend_semitones": 12.5})
    played = [TimedEvent(0.0, NoteOn(50, 90, KEYS)), TimedEvent(0.1, NoteOn(52, 90, 3))]
    found = written(tmp_path, played, patch)
    assert found == [*bend_range(12.5, 3), *bend_range(12.5, 0), NoteOn(50, 90), NoteOn(52, 90, 3)]
    mpe = written(tmp_path, [*played, TimedEvent(0.2, NoteOn(40, 9, 0))], patch.model_copy(update={"mode": "mpe"}))
    assert mpe[:12] == [*bend_range(12.5, 0), *bend_range(48, 3)]  # the master's, and a member's


def test_a_range_that_messages_set_stays_until_another_instrument(tmp_path: Path) -> None:
    patch = PATCHES["guitar"].model_copy(update={"mode": "poly", "bend_semitones": 2.0})
    wide = patch.model_copy(update={"bend_semitones": 7.0})
    other = wide.model_copy(update={"name": "another", "bend_semitones": 5.0})
    own = [TimedEvent(0.1, event) for event in bend_range(24, 1)]
    played = [TimedEvent(0.0, NoteOn(50, 90, 0)), *own, TimedEvent(0.2, PatchTurned(wide))]
    found = written(tmp_path, played, patch)
    assert found == [*bend_range(2, 0), *bend_range(2, 1), NoteOn(50, 90), *bend_range(24, 1), *bend_range(7, 0)]
    found = written(tmp_path, [*played, TimedEvent(0.3, PatchTurned(other))], patch)
    assert found[-12:] == [*bend_range(5, 0), *bend_range(5, 1)]
    found = written(tmp_path, [*played, *(TimedEvent(0.3, event) for event in release_all([1]))], patch)
    assert found[-8:] == [Controller(121, 0, 1), *bend_range(7, 1), Controller(7, 100, 1), Controller(123, 0, 1)][-8:]


def test_what_a_song_is_played_without_is_reported_once(tmp_path: Path) -> None:
    file = tmp_path / "song.mid"
    track = b"\0\xc0\x05" * 3 + b"\0\xb0\x0a\x40" * 2 + b"\0\xb0\x40\x00" + b"\0\xb0\x5b\x40" + b"\0\x90\x3c\xff"
    track += b"\0\xb0\xff\x40"
    file.write_bytes(b"MThd\0\0\0\6\0\1\0\2\0\x60MTrk" + len(track).to_bytes(4, "big") + track)
    assert read_song(file, None).left_out == (
        "song.mid is played without 1 track that its header counts; 1 message of a key or a controller above 127; "
        "what exceeds 127 in 1 message; its program changes and its controllers 10, 91"
    )


@pytest.mark.parametrize("pressure", [b"\0\xd0\x40", b"\0\xa0\x3c\x40"])
def test_pressure_is_reported_as_left_out(pressure: bytes, tmp_path: Path) -> None:
    file, track = tmp_path / "song.mid", pressure + b"\0\x90\x3c\x40"
    file.write_bytes(b"MThd\0\0\0\6\0\0\0\1\0\x60MTrk" + len(track).to_bytes(4, "big") + track)
    assert read_song(file, None).left_out == "song.mid is played without its pressure"


def test_a_folder_is_not_called_too_large(tmp_path: Path) -> None:
    with pytest.raises(MidiFileError, match="not an ordinary file; give another MIDI file"):
        read_midi(tmp_path)


def test_controllers_long_after_the_last_note_are_no_music(tmp_path: Path) -> None:
    file = tmp_path / "long.mid"
    timed = [TimedEvent(0.0, NoteOn(50, 90)), TimedEvent(0.5, NoteOff(50)), TimedEvent(1.0, Controller(64, 0))]
    file.write_bytes(midi_bytes([*timed, TimedEvent(600.0, Controller(64, 0)), TimedEvent(5_000.0, Bend(0.0))]))
    assert [each.time_s for each in read_midi(file)] == [0.0, 0.5, 1.0]
    assert read_song(file, None).length_s == 0.5


def song(folder: Path, *notes: tuple[int, int]) -> Path:
    """A file with a note for each key and channel, and the sustain pedal of each channel."""
    timed: list[TimedEvent] = []
    for number, (key, channel) in enumerate(notes):
        timed += [
            TimedEvent(0.5 * number, NoteOn(key, 90, channel)),
            TimedEvent(0.5 * number, Controller(64, 9, channel)),
        ]
    file = folder / "song.mid"
    file.write_bytes(midi_bytes(timed))
    return file


def notes_of(song: Song) -> list[tuple[int, int]]:
    return [(each.event.key, each.event.channel) for each in song.events if isinstance(each.event, NoteOn)]


def test_drums_are_no_strings_and_that_is_reported(tmp_path: Path) -> None:
    found = read_song(song(tmp_path, (60, 0), (36, 9), (62, 1)), None)
    assert notes_of(found) == [(60, 0), (62, 1)]
    assert channels_in(each.event for each in found.events) == {0, 1}
    assert found.left_out == "song.mid is played without its drums (channel 10)"
    with_drums = read_song(song(tmp_path, (60, 1), (36, 9)), PATCHES["mpe"])  # there channel 10 is a member
    assert (notes_of(with_drums), with_drums.left_out) == ([(60, 1), (36, 9)], "")
    assert read_song(song(tmp_path, (60, 0)), None).left_out == ""
    with pytest.raises(MidiFileError, match="only drums"):
        read_song(song(tmp_path, (36, 9)), None)


def test_a_file_of_one_channel_is_no_guitars(tmp_path: Path) -> None:
    one = song(tmp_path, (60, 3), (64, 3), (36, 9))
    assert notes_of(read_song(one, PATCHES["guitar"])) == [(60, KEYS), (64, KEYS)]
    assert channels_in(each.event for each in read_song(one, PATCHES["guitar"]).events) == {KEYS}
    assert notes_of(read_song(one, None)) == [(60, 3), (64, 3)]
    assert notes_of(read_song(song(tmp_path, (60, 3), (64, 0)), PATCHES["guitar"])) == [(60, 3), (64, 0)]


def test_notes_for_which_there_is_no_string_are_reported(tmp_path: Path, guitar: Patch) -> None:
    narrow = guitar.model_copy(update={"mode": "poly", "range": (40, 76)})
    found = read_song(song(tmp_path, (10, 0), (60, 0), (120, 0), (36, 9)), narrow)
    words = "its drums (channel 10) and 2 of its 3 notes, for which test has no string (E2 to E5)"
    assert found.left_out == f"song.mid is played without {words}"
    assert read_song(song(tmp_path, (60, 0)), narrow).left_out == ""


def test_what_does_not_matter_may_be_wrong(tmp_path: Path) -> None:
    """A key signature that nobody knows, and a text in no encoding."""
    file = song(tmp_path, (60, 0))
    raw = file.read_bytes()
    start = raw.index(b"MTrk") + 8
    odd = b"\x00\xff\x59\x02\x00\x02" + b"\x00\xff\x58\x00" + b"\x00\xff\x01\x02\xff\xfe"
    length = int.from_bytes(raw[start - 4 : start], "big") + len(odd)
    file.write_bytes(raw[: start - 4] + length.to_bytes(4, "big") + odd + raw[start:])
    assert read_midi(file) == read_midi(song(tmp_path, (60, 0)))


def test_keys_of_the_computer_are_written_on_the_first_channel(tmp_path: Path) -> None:
    file = tmp_path / "keys.mid"
    file.write_bytes(midi_bytes([TimedEvent(0.0, NoteOn(60, 90, KEYS)), TimedEvent(0.5, NoteOff(60, KEYS))]))
    assert [each.event for each in read_midi(file)] == [NoteOn(60, 90), NoteOff(60)]
