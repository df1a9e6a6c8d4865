"""Impulse responses as `engine.kernels` computes and convolves them, with the memory for it; (frames, 2) each."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from engine import bounds
from engine.kernels import bodies, constants, convolver, fourier, responses
from engine.kernels.fields import record_of
from engine.kernels.mixer_records import CONVOLVER, IMPULSE, WINDOW

Response = NDArray[np.float64]
LONGEST_S = 2 * bounds.LONGEST_IMPULSE_S  # a body's and a room's


def work_space(size: int) -> NDArray[np.float64]:
    """A work space for transforms of up to so many numbers: (rows, a power of two), two of them cosines and sines."""
    work = np.empty((fourier.ROWS, fourier.power_of_two(max(size, 4))))
    fourier.fill_circle(work[fourier.COSINES], work[fourier.SINES])
    return work


def _work_at(frames: int, rate_hz: float) -> NDArray[np.float64]:
    """A work space for a response that is measured, too."""
    return work_space(max(2 * frames, int(rate_hz)))


def stereo(samples: NDArray[np.float64]) -> Response:
    """A response of one or two channels as a new one of two, which may be written: kernels are compiled for these."""
    return np.array(np.broadcast_to(samples, (len(samples), 2)), np.float64)


def resampled(samples: NDArray[np.float64], from_hz: float, to_hz: float) -> Response:
    """A response at another rate."""
    from_hz, to_hz = float(from_hz), float(to_hz)
    resampled_samples = np.empty((responses.resampled_frames(len(samples), from_hz, to_hz), 2))
    work = work_space(responses.work_size(len(samples), from_hz, to_hz))
    responses.resample(work, stereo(samples), from_hz, to_hz, resampled_samples)
    return resampled_samples


def faded(samples: NDArray[np.float64]) -> Response:
    """A response of one or two channels with its end faded to nothing."""
    sound = stereo(samples)
    responses.fade(sound)
    return sound[:, : samples.shape[1]]


def as_loud(samples: NDArray[np.float64], rate_hz: float) -> Response:
    """The response times a factor: noise of equal power in each octave keeps it, in the mean of both channels."""
    sound = stereo(samples)
    responses.level(_work_at(len(sound), rate_hz), sound, float(rate_hz))
    return sound


def of_modes(modes: NDArray[np.float64], seconds: float, subsonic_hz: float, size: float, rate_hz: float) -> Response:
    """The response of a body of modes, see `engine.kernels.bodies`.

    Args:
        modes: (4, modes) at a size of 1: Hz, decay in 1/s, amplitudes left and right.
        seconds: the length at a size of 1.
        subsonic_hz: below it the body radiates next to nothing, at a size of 1.
    """
    size, rate_hz = float(size), float(rate_hz)
    response = np.empty((bodies.rung_frames(seconds, size, rate_hz), 2))
    bodies.respond(_work_at(len(response), rate_hz), modes, subsonic_hz, size, rate_hz, response)
    return response


def of_given(samples: NDArray[np.float64], own_hz: float, size: float, rate_hz: float) -> Response:
    """The response of a body that is given as one, at its size."""
    own_hz = float(own_hz)
    size = float(size)
    rate_hz = float(rate_hz)
    frames = bodies.given_frames(len(samples), own_hz, size, rate_hz, bounds.LONGEST_IMPULSE_S)
    response = np.empty((frames, 2))
    work = work_space(max(responses.work_size(len(samples), own_hz / size, rate_hz), int(rate_hz)))
    bodies.respond_as(work, stereo(samples), own_hz, size, rate_hz, response)
    return response


def in_series(one: Response, other: Response) -> Response:
    """The response of one behind the other."""
    both = np.empty((len(one) + len(other) - 1, 2))
    responses.series(work_space(len(both)), stereo(one), stereo(other), both)
    return both


def powers_of(body: Response, room: Response, rate_hz: float) -> NDArray[np.float64]:
    """The powers (4, 4, 4) that `weights_of` needs; what is not there has no frames.

    The first axis is the case (1: body alone, 2: room alone, 3: both), the others the parts, as of `weights_of`.
    """
    powers = np.empty((4, 4, 4))
    responses.all_powers(_work_at(len(body) + len(room), rate_hz), stereo(body), stereo(room), float(rate_hz), powers)
    return powers


def weights_of(powers: NDArray[np.float64], body_mix: float, room_mix: float) -> NDArray[np.float64]:
    """The weights (4,) of the parts of a mix: nothing, body, room, and both in series."""
    weights = np.empty(4)
    responses.weigh(powers, float(body_mix), float(room_mix), weights)
    return weights


def curves_of(response: Response) -> NDArray[np.float64]:
    """The effect of a body on a key's loudness (BODY_SLOTS,), from its response at CURVES_HZ."""
    curve = np.empty(constants.BODY_SLOTS)
    work = work_space(responses.curves_size(len(response)))
    responses.curves(work, stereo(response), curve)
    return curve


def partitioned(impulse: NDArray[np.float64]) -> NDArray[np.float64]:
    """A response (frames, channels) as the compiled convolver reads it: spectra of its partitions."""
    frames, channels = impulse.shape
    memory = np.zeros(convolver.partitioned_slots(frames, channels))
    convolver.partition(work_space(2 * WINDOW), np.array(impulse), frames, record_of(memory, IMPULSE))
    return memory


def convolver_memory(rate_hz: int) -> NDArray[np.float64]:
    """The memory of a convolver for responses of up to `LONGEST_S`."""
    frames = round(LONGEST_S * rate_hz)
    memory = np.empty(convolver.convolver_slots(frames))
    memory[:] = 0.0  # written to, so that the device's thread finds every page in place
    convolver.begin(record_of(memory, CONVOLVER), float(rate_hz), frames)
    return memory
