"""The fidelity of a preset's sound in a musician's words.

Only what can be heard is named: 3 cents (0.2 %) and 1 dB are about the least that is noticed between two tones
(Moore, "An Introduction to the Psychology of Hearing"). For changes of level the threshold is 2 dB, because they
are heard over seconds of decay and not from one tone to the next.
"""

from __future__ import annotations

import math

from training.heard_file import Heard

NOTICED_CENTS = 3.0
NOTICED_CHANGE_DB = 2.0
NOTICED_DISTANCE_DB = 1.0
NOTICED_HUM_DB = -80.0  # of full scale: 40 dB below a soft pluck; a quiet room hides what is softer
UNMEASURED = "not measured"
HEARD_TIP = (
    f"How true it sounds compared with the solved string, rung out past its training: true, where the spectra are "
    f"less than {NOTICED_DISTANCE_DB:g} dB apart and no fault can be heard; else the worst fault, or that distance"
)


def heard_word(row: Heard | None) -> str:
    """The word for a list: "true", the worst fault, or the distance of the spectra in dB."""
    if row is None:
        return UNMEASURED
    if words := faults(row):
        return words[0] if len(words) == 1 else f"{words[0]} …"
    return "true" if row.distance_db < NOTICED_DISTANCE_DB else f"{row.distance_db:.1f} dB off"


def heard_sentence(row: Heard | None, name: str) -> str:
    """The sentence for a preset's card: all faults, and the distance of the spectra in dB. `name`: the preset's."""
    if row is None:
        return f"{UNMEASURED}; to measure it: learned-strings evaluate {name} --heard --write"
    apart = f"spectra {row.distance_db:.2g} dB apart over {row.seconds:.2g} s"
    if words := faults(row):
        return f"past training: {'; '.join(words)}; {apart}"
    return f"{'true' if row.distance_db < NOTICED_DISTANCE_DB else 'not quite true'}: {apart}"


def faults(row: Heard) -> list[str]:
    """Every fault above its threshold, in words; first the one that exceeds its threshold by the largest factor."""
    weighted = []
    if row.runs_away_s is not None:
        weighted.append((math.inf, f"diverges after {row.runs_away_s:.1f} s"))
    if abs(row.level_db) >= NOTICED_CHANGE_DB:
        louder = "grows" if row.rise_db >= NOTICED_CHANGE_DB else "fades too slowly"
        what = louder if row.level_db > 0 else "decays too fast"
        weighted.append((abs(row.level_db) / NOTICED_CHANGE_DB, f"{what}, {_signed(row.level_db)} dB"))
    if row.split_cents is not None:
        weighted.append((row.split_cents / NOTICED_CENTS, f"two pitches, {row.split_cents:.0f} cents apart"))
    if row.pitch_cents is not None and abs(row.pitch_cents) >= NOTICED_CENTS:
        which = "high" if row.pitch_cents > 0 else "low"
        weighted.append((abs(row.pitch_cents) / NOTICED_CENTS, f"pitch {abs(row.pitch_cents):.0f} cents too {which}"))
    if row.hum_db is not None and row.hum_db >= NOTICED_HUM_DB:
        loudness = 10 ** ((row.hum_db - NOTICED_HUM_DB) / 20)
        weighted.append((loudness, f"residual hum at {_signed(row.hum_db)} dB"))
    return [text for _, text in sorted(weighted, key=lambda fault: -fault[0])]


def _signed(value: float) -> str:
    return f"{'+' if value > 0 else '−'}{abs(value):.0f}"
