"""Generated scales, against closed formulas of each pitch, which are derived in another way."""

from __future__ import annotations

import numpy as np
import pytest

from app.instruments.scala import parse_scale
from app.instruments.scales import SCALES
from app.instruments.tuning import Tuning, TuningChoice

Q, E, V = 5**0.25, 2**0.25, 2 ** (13 / 6) / 3  # fifths of meantone and Vallotti; a step of Werckmeister's roots
RATIOS = {  # as formulas, of which several hold a step or a fifth that is no ratio of whole numbers
    "19 equal": " ".join(f"2**({step}/19)" for step in range(1, 20)),
    "24 equal": " ".join(f"2**({step}/24)" for step in range(1, 25)),
    "31 equal": " ".join(f"2**({step}/31)" for step in range(1, 32)),
    "Pythagorean": "2187/2048 9/8 32/27 81/64 4/3 729/512 3/2 6561/4096 27/16 16/9 243/128 2",
    "Quarter": "Q**7/16 Q**2/2 4/Q**3 5/4 2/Q Q**6/8 Q 25/16 Q**3/2 4/Q**2 Q**5/4 2",
    "Just": "16/15 9/8 6/5 5/4 4/3 45/32 3/2 8/5 5/3 9/5 15/8 2",
    "Harmonics": "9/8 10/8 11/8 12/8 13/8 14/8 15/8 2",
    "Werckmeister": "256/243 64/81*E**2 32/27 256/243*E 4/3 1024/729 8/9*E**3 128/81 1024/729*E 16/9 128/81*E 2",
    "Kirnberger": "256/243 Q**2/2 32/27 5/4 4/3 45/32 Q 128/81 Q**3/2 16/9 15/8 2",
    "Vallotti": "128/(81*V) V**2/2 16/(9*V) V**4/4 2/V 3*V**5/16 V 64/(27*V) V**3/2 8/(3*V) V**5/4 2",
    "Slendro": "2**(1/5) 2**(2/5) 2**(3/5) 2**(4/5) 2",
    "Pelog": "2**(1/9) 2**(2/9) 2**(4/9) 2**(5/9) 2**(6/9) 2**(7/9) 2",
    "Bohlen": " ".join(f"3**({step}/13)" for step in range(1, 14)),
}


@pytest.mark.parametrize("name", SCALES)
def test_a_scale_has_the_pitches_of_its_formula_and_tunes_keys_from_c_with_a4_where_it_was(name: str) -> None:
    (formulas,) = (wanted for key, wanted in RATIOS.items() if name.startswith(key))
    ratios = [eval(formula, {"Q": Q, "E": E, "V": V}) for formula in formulas.split()]
    np.testing.assert_allclose(1200 * np.array(parse_scale(SCALES[name]).octaves), 1200 * np.log2(ratios), atol=1e-5)
    tuning = Tuning(TuningChoice(a4_hz=432.0, scale=SCALES[name]))
    assert tuning.hz(69) == pytest.approx(432.0)
    found = np.array([tuning.hz(61 + step) for step in range(len(ratios))]) / tuning.hz(60)
    np.testing.assert_allclose(found, ratios, rtol=1e-8)
    assert SCALES[name].splitlines()[0] == name, "which the bar shows"
