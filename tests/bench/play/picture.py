"""How far the picture is behind the sound: the first changed picture of the screen after a key out of silence.

Only a part of the window's upper half is compared, where the string is drawn, because the controls below it change
with a key, too.
"""

from __future__ import annotations

import time
from collections.abc import Sequence

import numpy as np

from tests.bench.play import hands
from tests.bench.play.recording import Recording
from tests.bench.play.screen import SIZE, Screen

LEFT, TOP, WIDTH, HEIGHT = SIZE[0] * 5 // 8, SIZE[1] // 8, SIZE[0] // 4, SIZE[1] // 3
LOOK_S = 0.004
WATCH_S = 0.5
QUIET_S = 0.6


def picture_lags(
    screen: Screen, recorded: Recording, count: int, keys: Sequence[str], stop: str
) -> list[tuple[float, float]]:
    """For single plucks: when the key was pressed, and when the picture had changed, to within some 10 ms.

    Plucks before which the picture was still moving are left out.
    """
    found = []
    for number in range(count):
        time.sleep(QUIET_S)
        before = screen.grab(LEFT, TOP, WIDTH, HEIGHT)
        time.sleep(0.1)
        rests = np.array_equal(before, screen.grab(LEFT, TOP, WIDTH, HEIGHT))
        pressed_s = hands.tap(screen, keys[number % len(keys)])
        changed_s = None
        while changed_s is None and time.monotonic() < pressed_s + WATCH_S:
            looked_s = time.monotonic()
            if not np.array_equal(before, screen.grab(LEFT, TOP, WIDTH, HEIGHT)):
                changed_s = (looked_s + time.monotonic()) / 2
            time.sleep(LOOK_S)
        time.sleep(max(pressed_s + WATCH_S - time.monotonic(), 0))
        hands.tap(screen, stop)
        recorded.wait_for_silence(0.2, 2.0)
        if rests and changed_s is not None:
            found.append((pressed_s, changed_s))
    return found
