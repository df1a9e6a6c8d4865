"""The chosen pluck as WAV files: for the export dialog, and for files dragged out of the window."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

from app.export.choices import ExportChoices
from app.export.files import SoundRequest, Source, WavReport, default_file_name, export_sounds
from app.presets.library import PresetEntry
from app.session.choices import Choices
from app.shared.worker import Progress
from app.views.dialogs.sound_form import wav_settings
from engine.presets import load_preset, of_string


def string_word(choices: Choices) -> str:
    """The string that is plucked by a preset of many, as the frequency of its first mode; "" for the preset's own."""
    return "" if choices.string is None else f"{choices.string.first_hz:.1f} Hz"


def suggested_name(preset: PresetEntry, choices: Choices, rate_hz: int, source: Source) -> str:
    """A file name that names preset, string, pluck, rate and source."""
    string = string_word(choices).replace(" ", "")
    name = f"{preset.name}_{string}" if string else preset.name
    return default_file_name(name, choices.pluck, rate_hz or preset.info.rate_hz, source)


def export_chosen(
    preset: PresetEntry,
    choices: Choices,
    export: ExportChoices,
    paths: Mapping[Source, Path],
    progress: Progress,
) -> list[WavReport]:
    """Renders the pluck of a string once, and writes a file for each source. Any thread.

    Args:
        paths: the files to write, by source.

    Raises:
        PresetError: the preset cannot be used, or cannot play the string that is chosen.
        As `export_sounds`.
    """
    loaded = load_preset(preset.path)
    if loaded.info.family is not None:  # it plays any string at any rate
        string = choices.string.parameters if choices.string else None
        loaded = of_string(loaded, string, export.rate_hz or None)
    request = SoundRequest(
        loaded,
        choices.pluck,
        choices.listen,
        export.longest_s if export.until_decayed else export.seconds,
        next(iter(paths)),
        choices.listen_right if choices.stereo else None,
        choices.pickup,
        export.difference_gain_db if "difference" in paths else 0.0,
        export.decay_db if export.until_decayed else None,
    )
    settings = wav_settings(export)
    return export_sounds(request, paths, settings, progress=progress)[0]
