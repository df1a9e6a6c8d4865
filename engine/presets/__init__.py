"""Presets: trained weights with what they were trained on, in one safetensors file. Data, never code.

info        what a preset says of itself
file        the file and all its checks
finding     which files there are
of_string   a preset of many strings, of one that is given
migrations  from what earlier versions wrote
"""

from engine.presets.file import (
    Preset,
    PresetError,
    described_parameters,
    load_preset,
    preset_digest,
    read_info,
    save_preset,
)
from engine.presets.finding import SHIPPED, find_preset, preset_files, unreadable
from engine.presets.info import PresetInfo, TrainedRange, outside_training
from engine.presets.of_string import STRINGS, find_string, of_string, read_described_string, read_string

__all__ = [
    "SHIPPED",
    "STRINGS",
    "Preset",
    "PresetError",
    "PresetInfo",
    "TrainedRange",
    "described_parameters",
    "find_preset",
    "find_string",
    "load_preset",
    "of_string",
    "outside_training",
    "preset_digest",
    "preset_files",
    "read_described_string",
    "read_info",
    "read_string",
    "save_preset",
    "unreadable",
]
