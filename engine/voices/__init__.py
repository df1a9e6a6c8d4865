"""The voices, plucks of a model or of the truth as they ring, and the mixer that sums them.

They are compiled in `engine.kernels`.

program    what all voices of a source share at one sample rate
programs   those of a preset, and of the truth
ear        the signal of a string for who listens to it, and velocity from displacement
memory     what kernels read and write
voice      one pluck of a program
mixer      the sum: what a device plays
offline    a voice for a file
"""

from engine.voices.mixer import Gap, Mixer
from engine.voices.offline import ModelFrames, OfflineVoice, render_voice, voice_blocks
from engine.voices.player import CompiledPlayer
from engine.voices.program import Program
from engine.voices.programs import model_program, plain_program, rendered_program, truth_program
from engine.voices.voice import Voice

__all__ = [
    "CompiledPlayer",
    "Gap",
    "Mixer",
    "ModelFrames",
    "OfflineVoice",
    "Program",
    "Voice",
    "model_program",
    "plain_program",
    "render_voice",
    "rendered_program",
    "truth_program",
    "voice_blocks",
]
