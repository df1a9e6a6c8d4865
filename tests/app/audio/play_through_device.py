"""Plays a track through the default device and prints what the player says, as JSON.

A script of its own, because ALSA and PulseAudio read their settings once per process:

    python play_through_device.py TRACK.npz switch        select the truth on the way, play to the end
    python play_through_device.py TRACK.npz kill PID      end the sound server PID on the way
    python play_through_device.py TRACK.npz live OUT.npy  pluck, switch, loop; OUT: what the mixer gave
"""

import json
import os
import signal
import sys
import time
from collections.abc import Callable, Sequence

import numpy as np
from app.audio.stream import OutputStream

from app.audio import AudioProblem, Player, Track


def wait_until(condition: Callable[[], bool], timeout_s: float = 8.0) -> None:
    deadline_s = time.monotonic() + timeout_s
    while not condition() and time.monotonic() < deadline_s:
        time.sleep(0.005)


def kept_blocks() -> list[np.ndarray]:
    """All blocks that go to any device from now on, without those that were replaced unheard."""
    blocks: list[np.ndarray] = []
    write, replace = OutputStream.write, OutputStream.replace

    def keep(stream: OutputStream, block: np.ndarray) -> None:
        write(stream, block)
        blocks.append(block)

    def change(stream: OutputStream, count: int, others: Sequence[np.ndarray] = ()) -> bool:
        done = replace(stream, count, others)
        if done:
            del blocks[max(0, len(blocks) - count) :]  # more, where some came before this began
            blocks.extend(others)
        return done

    OutputStream.write, OutputStream.replace = keep, change  # type: ignore[method-assign]
    return blocks


def play_live(player: Player, track: Track, out_file: str) -> None:
    blocks = kept_blocks()
    player.set_loop(True)
    for source in ("truth", "model", "truth"):
        player.load(track, ring=True)
        player.play()
        time.sleep(0.4)
        player.select(source)
        time.sleep(0.4)
    wait_until(lambda: player.status().position_s > 1.8)
    wait_until(lambda: player.status().position_s < 0.5)  # the loop
    player.stop()
    time.sleep(0.5)
    np.save(out_file, np.concatenate(blocks))


def main(track_file: str, action: str, *argument: str) -> None:
    sources = np.load(track_file)
    problems: list[AudioProblem] = []
    with Player(problems.append) as player:
        player.open(buffer_s=0.2)  # the computer may be busy with other tests
        wait_until(lambda: player.status().device is not None or problems != [])
        track = Track(player.rate_hz, sources["model"].size, ("model", "truth"))
        track.append(sources)
        time.sleep(0.3)  # let the device settle
        player.load(track)
        player.play()
        wait_until(lambda: player.status().position_s > 0.4)
        if action == "live":
            play_live(player, track, argument[0])
        elif action == "kill":
            os.kill(int(argument[0]), signal.SIGKILL)
            wait_until(lambda: player.status().device is None)
        else:
            player.select("truth")
        if action != "live":
            wait_until(lambda: player.status().position_s >= track.length_frames / track.rate_hz)
        time.sleep(0.2)  # the end is still on its way through the sound server
        status = player.status()
    print(
        json.dumps(
            {
                "rate_hz": status.rate_hz,
                "underruns": status.underruns,
                "position_s": status.position_s,
                "problems": [problem.kind for problem in problems],
                "details": [problem.detail for problem in problems],
            }
        )
    )


if __name__ == "__main__":
    main(*sys.argv[1:])
