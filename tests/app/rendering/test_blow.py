"""A blow on a drum: what pictures, signals and errors show of it agrees with the engine, at any speed."""

from __future__ import annotations

import threading
from collections.abc import Iterator
from concurrent.futures import Executor, ThreadPoolExecutor
from dataclasses import replace

import numpy as np
import pytest
import torch

from app.instruments.drums import Drums, PlayedDrum
from app.instruments.instrument import Instrument
from app.player.drum_keys import DrumKeys
from app.player.events import NoteOn
from app.rendering import NoteSound, Take, drum_line
from app.rendering.blow import RATE_HZ, BlowTake, Head
from app.rendering.job import RenderJob
from app.rendering.note_sound import Struck
from app.rendering.strobe import FLASH_HZ
from app.rendering.subject import Loaded
from app.rendering.worker import RenderWorker
from engine.pluck import Pluck
from engine.presets import SHIPPED, PresetError, load_preset
from engine.resonators.drum import DrumModes
from engine.strike import Strike
from engine.truth import ModalState, SplittingSolver
from engine.values.drum import DrumParameters
from engine.values.ear import Ear
from training.family.drums import StruckDrum
from training.family.motion import model_player, motion_errors

PRESET = SHIPPED / "studio_any_string.safetensors"
LOADED = Loaded(load_preset(PRESET))
STEEL = DrumParameters(
    shape="rectangle",
    length_m=0.3,
    width_m=0.2,
    thickness_m=0.001,
    density_kg_m3=7850.0,
    youngs_modulus_pa=2e11,
    poisson=0.3,
    tension_n_m=0.0,
)
PLACE, HARDEST, SOFTEST = (0.3, 0.1), 8.0, 0.01


def drum_of(drum: DrumParameters, highest_hz: float) -> Instrument:
    """An instrument of one drum."""
    played = PlayedDrum(note=60, name="Drum", drum=drum, place=PLACE, softest_m_s=SOFTEST, hardest_m_s=HARDEST)
    return Instrument(name="Drum", category="drums", strings=Drums(drums=(played,), highest_hz=highest_hz))


def modes_in(instrument: Instrument) -> DrumModes:
    drum_key = DrumKeys(instrument, Ear((0.5,))).of_key(60)
    assert drum_key is not None
    return drum_key.modes


TOM = drum_of(DrumParameters(uneven=0.004, air_kg_m3=1.2), 1_500.0)
PLATE = drum_of(STEEL, 3_000.0)
BAR = drum_of(replace(STEEL, shape="bar", width_m=0.03, thickness_m=0.002), 4_000.0)
TOM_MODES = modes_in(TOM)
HARD, SOFT = Strike(PLACE, HARDEST), Strike(PLACE, SOFTEST)


class Log:
    def __init__(self) -> None:
        self.calls: list[str] = []

    def say(self, signal_name: str, *values: object) -> None:
        assert signal_name in ("started", "finished"), values
        self.calls.append(signal_name)


@pytest.fixture
def helper() -> Iterator[Executor]:
    with ThreadPoolExecutor(1) as pool:
        yield pool


def request_of(instrument: Instrument, velocity: int = 127, seconds: float = 0.25) -> NoteSound:
    return NoteSound(PRESET, Pluck(), seconds, Ear((0.5,)), struck=Struck(instrument, NoteOn(60, velocity)))


def rendered(request: NoteSound, helper: Executor) -> BlowTake:
    log = Log()
    job = RenderJob(request, lambda _: LOADED, log.say, helper)
    while not job.idle:
        job.advance()
    assert log.calls == ["started", "finished"]
    assert job.take is not None
    return job.take


def true_amplitudes(modes: DrumModes, strike: Strike, frames: int) -> np.ndarray:
    """(frames + 1, modes) in m."""
    solver = SplittingSolver(modes.resonator(np.zeros((1, 2))), RATE_HZ)
    speeds = torch.from_numpy(strike.speeds(modes))[None]
    return solver.solve(ModalState(torch.zeros_like(speeds), speeds), frames)[0].numpy()


@pytest.mark.parametrize("instrument", [TOM, PLATE, BAR], ids=["tom", "plate", "bar"])
def test_in_real_time_a_picture_is_the_true_motion(instrument: Instrument, helper: Executor) -> None:
    take, modes = rendered(request_of(instrument), helper), modes_in(instrument)
    true = true_amplitudes(modes, HARD, take.frames - 1)
    head = take.head
    shapes = modes.shapes(head.places)[: len(head.shapes)]
    for flash in (0, 1, 7, take.motions["truth"].flashes - 1):
        amplitudes = take.modal_m("truth", flash / FLASH_HZ + 1e-9, 1.0)
        assert amplitudes is not None
        picture = head.picture(amplitudes)
        expected = true[round(flash / FLASH_HZ * RATE_HZ)][: len(shapes)] @ shapes
        assert picture[head.inside] == pytest.approx(expected, abs=1e-5 * np.abs(true).max())
        assert (picture[~head.inside] == 0).all()


def test_in_slow_motion_each_mode_turns_slowly_and_decays_in_real_time(helper: Executor) -> None:
    """A quiet drum is linear: each mode is v₀/ω' e^(-σt) sin(ω's t) at the speed s."""
    take, speed = rendered(request_of(TOM, 1), helper), 0.03
    omega, sigma = np.sqrt(TOM_MODES.omega**2 - TOM_MODES.sigma**2), TOM_MODES.sigma
    sizes = SOFT.speeds(TOM_MODES) / omega
    for flash in (0, 3, 12, 28):
        time_s = flash / FLASH_HZ
        expected = sizes * np.exp(-sigma * time_s) * np.sin(speed * omega * time_s)
        found = take.modal_m("truth", time_s + 1e-9, speed)
        assert found == pytest.approx(expected * TOM_MODES.scale, abs=0.03 * np.abs(sizes * TOM_MODES.scale).max())
        assert np.square(found - expected * TOM_MODES.scale).sum() <= 1e-3 * np.square(sizes * TOM_MODES.scale).sum()


def test_the_difference_is_that_of_the_motions(helper: Executor) -> None:
    take = rendered(request_of(TOM), helper)
    for time_s in (0.01, 0.1, 0.25):
        parts = [take.modal_m(name, time_s, 1.0) for name in ("model", "truth", "difference")]
        model, truth, difference = (part for part in parts if part is not None)
        assert difference == pytest.approx(model - truth, abs=1e-12 * np.abs(truth).max())
        assert 0 < np.abs(difference).max() < 1e-4 * np.abs(truth).max()


def test_any_length_of_blocks_gives_the_same(helper: Executor, monkeypatch: pytest.MonkeyPatch) -> None:
    one = rendered(request_of(TOM), helper)
    monkeypatch.setattr(drum_line, "BLOCK_FRAMES", 317)
    other = rendered(request_of(TOM), helper)
    for name in ("model", "truth"):
        assert other.motions[name].ready == one.motions[name].ready == one.motions[name].flashes
        assert other.motions[name].size_m == pytest.approx(one.motions[name].size_m, abs=1e-12)
        assert other.modal_m(name, 0.2, 0.01) == pytest.approx(one.modal_m(name, 0.2, 0.01), abs=1e-10)
        first, second = (take.listened.signals[name].read() for take in (one, other))
        assert second == pytest.approx(first, rel=1e-5, abs=1e-6)
    assert other.error_course.rel_mse == pytest.approx(one.error_course.rel_mse, rel=1e-3)


def test_errors_are_those_over_the_surface(helper: Executor) -> None:
    take = rendered(request_of(TOM), helper)
    resonator, speeds = TOM_MODES.resonator(np.zeros((1, 2))), HARD.speeds(TOM_MODES)
    struck = StruckDrum(resonator, np.zeros(len(TOM_MODES)), speeds, TOM_MODES.scale**2, 0.1, "tom", TOM_MODES.drum)
    players = {"model": model_player(LOADED.preset.model)}
    expected = motion_errors(struck, players, RATE_HZ, take.frames - 1)[0].rel_mse
    assert take.error_course.rel_mse == pytest.approx(expected["model"], rel=0.01)
    curve = take.error_course.curves["rmse"][: take.error_course.ready]
    assert take.error_course.ready == take.error_course.windows > 5
    assert curve.min() <= np.sqrt(expected["model"]) <= curve.max()
    assert np.abs(take.error_course.curves["level_db"]).max() < 0.01


def test_another_direction_changes_the_sound_alone(helper: Executor) -> None:
    job = RenderJob(request_of(TOM), lambda _: LOADED, Log().say, helper)
    while not job.idle:
        job.advance()
    take = job.take
    assert take is not None
    before, shown = take.listened, take.motions["truth"].size_m.copy()
    moved = replace(job.request, ear=Ear((0.1, 0.9)))
    assert moved.same_motion(job.request)
    job.ask_again(moved)
    while not job.idle:
        job.advance()
    assert job.take is take
    assert (take.motions["truth"].size_m == shown).all()
    true = true_amplitudes(TOM_MODES, HARD, take.frames - 1)
    for column, point in enumerate((0.1, 0.9)):
        expected = true @ TOM_MODES.radiated((2 * point - 1, 0.0))
        found = take.listened.signals["truth"].read()[:, column]
        assert found == pytest.approx(expected[: len(found)], abs=1e-4 * np.abs(expected).max())
    assert take.listened is not before


def test_another_blow_is_another_motion() -> None:
    asked = request_of(TOM)
    for other in (
        request_of(TOM, 126),
        request_of(TOM.with_value("knobs.decay", 0.5)),
        replace(asked, seconds=1.0),
        replace(asked, struck=None),
        request_of(PLATE),
        None,
    ):
        assert not asked.same_motion(other)
    assert asked.same_motion(request_of(TOM))


def test_the_edge_of_a_head_rests_and_a_bar_moves_alike_across() -> None:
    for modes in (TOM_MODES, modes_in(PLATE)):
        head = Head.of(modes.surface, (modes.drum.length_m, modes.drum.width_m))
        picture = head.picture(np.ones(4))
        rows, columns = picture.shape
        for edge in (picture[0, columns // 2], picture[-1, columns // 2], picture[rows // 2, 0]):
            assert abs(edge) < 1e-5 * np.abs(picture).max()
    bar = Head.of(modes_in(BAR).surface, (0.3, 0.03)).picture(np.ones(3))
    assert (bar == bar[:1]).all()
    assert np.abs(bar).max() > 0.5


def test_a_preset_of_one_string_is_refused(helper: Executor) -> None:
    nylon = Loaded(load_preset(SHIPPED / "studio_nylon_b3.safetensors"))
    job = RenderJob(request_of(TOM), lambda _: nylon, Log().say, helper)
    with pytest.raises(PresetError, match="many strings"):
        job.advance()


def test_the_worker_renders_blows() -> None:
    done, takes = threading.Event(), []

    def say(signal_name: str, take: Take | BlowTake) -> None:
        if signal_name == "finished":
            takes.append(take)
            done.set()

    worker = RenderWorker(say, lambda _: LOADED)
    try:
        worker.submit(request_of(BAR, seconds=0.1))
        assert done.wait(60)
    finally:
        worker.close()
    (take,) = takes
    assert take.complete
    assert take.listened.complete
    assert np.abs(take.listened.signals["model"].read()).max() > 0
