"""A blow on a drum: what pictures, signals and errors show of it agrees with the engine, at any speed."""

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
from app.rendering import NoteSound, drum_line
from app.rendering.blow import RATE_HZ, BlowTake
from app.rendering.job import RenderJob
from app.rendering.note_sound import Struck
from app.rendering.strobe import FLASH_HZ
from app.rendering.subject import Loaded
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
STEEL = DrumParameters("rectangle", 0.3, 0.2, 0.001, 7850.0, 2e11, 0.3, 0.0)
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
HARD = Strike(PLACE, HARDEST)


@pytest.fixture
def helper() -> Iterator[Executor]:
    with ThreadPoolExecutor(1) as pool:
        yield pool


def request_of(instrument: Instrument, velocity: int = 127, seconds: float = 0.25) -> NoteSound:
    return NoteSound(PRESET, Pluck(), seconds, Ear((0.5,)), struck=Struck(instrument, NoteOn(60, velocity)))


def finish(job: RenderJob) -> BlowTake:
    while not job.idle:
        job.advance()
    assert isinstance(job.take, BlowTake)
    return job.take


def rendered(request: NoteSound, helper: Executor) -> BlowTake:
    said: list[str] = []
    take = finish(RenderJob(request, lambda _: LOADED, lambda name, take: said.append(name), helper))
    assert said == ["started", "finished"]
    return take


@pytest.fixture(scope="module")
def tom() -> BlowTake:
    """A hard blow on it."""
    with ThreadPoolExecutor(1) as pool:
        return rendered(request_of(TOM), pool)


def true_amplitudes(modes: DrumModes, strike: Strike, frames: int) -> np.ndarray:
    """(frames + 1, modes) in m."""
    solver = SplittingSolver(modes.resonator(np.zeros((1, 2))), RATE_HZ)
    speeds = torch.from_numpy(strike.speeds(modes))[None]
    return solver.solve(ModalState(torch.zeros_like(speeds), speeds), frames)[0].numpy()


@pytest.mark.parametrize("instrument", [TOM, PLATE, BAR], ids=["tom", "plate", "bar"])
def test_in_real_time_a_picture_is_the_true_motion(instrument, helper):
    take, modes = rendered(request_of(instrument), helper), modes_in(instrument)
    head, true = take.head, true_amplitudes(modes, HARD, take.frames - 1)
    shapes = modes.shapes(head.places)[: len(head.shapes)]
    for flash in (0, 1, 7, take.motions["truth"].flashes - 1):
        amplitudes = take.modal_m("truth", flash / FLASH_HZ + 1e-9, 1.0)
        assert amplitudes is not None
        picture = head.picture(amplitudes)
        expected = true[round(flash / FLASH_HZ * RATE_HZ)][: len(shapes)] @ shapes
        assert picture[head.inside] == pytest.approx(expected, abs=1e-5 * np.abs(true).max())
        assert (picture[~head.inside] == 0).all()
        model, difference = (take.modal_m(name, flash / FLASH_HZ, 1.0) for name in ("model", "difference"))
        truth = take.modal_m("truth", flash / FLASH_HZ, 1.0)
        assert difference == pytest.approx(model - truth, abs=1e-12 * np.abs(true).max())
        assert np.abs(difference).max() < 1e-3 * np.abs(true).max()
    # the edge of a head rests, and a bar moves alike across
    picture = head.picture(np.ones(3))
    rows, columns = picture.shape
    edges = np.abs([picture[0, columns // 2], picture[-1, columns // 2], picture[rows // 2, 0]]).max()
    assert (picture == picture[:1]).all() if instrument is BAR else edges < 1e-5 * np.abs(picture).max()


def test_in_slow_motion_each_mode_turns_slowly_and_decays_in_real_time(helper):
    """A quiet drum is linear: each mode is v₀/ω' e^(-σt) sin(ω's t) at the speed s."""
    take, speed = rendered(request_of(TOM, 1), helper), 0.03
    omega, sigma = np.sqrt(TOM_MODES.omega**2 - TOM_MODES.sigma**2), TOM_MODES.sigma
    sizes = Strike(PLACE, SOFTEST).speeds(TOM_MODES) / omega * TOM_MODES.scale
    for time_s in np.array([0, 3, 12, 28]) / FLASH_HZ:
        expected = sizes * np.exp(-sigma * time_s) * np.sin(speed * omega * time_s)
        found = take.modal_m("truth", time_s + 1e-9, speed)
        assert found == pytest.approx(expected, abs=0.03 * np.abs(sizes).max())
        assert np.square(found - expected).sum() <= 1e-3 * np.square(sizes).sum()


def test_any_blocks_give_the_same(tom, helper, monkeypatch):
    monkeypatch.setattr(drum_line, "BLOCK_FRAMES", 317)
    other = rendered(request_of(TOM), helper)
    for name in ("model", "truth"):
        one, two = (take.motions[name] for take in (tom, other))
        assert two.ready == one.ready == one.flashes
        assert two.size_m == pytest.approx(one.size_m, abs=1e-12)
        assert other.modal_m(name, 0.2, 0.01) == pytest.approx(tom.modal_m(name, 0.2, 0.01), abs=1e-10)
        first, second = (take.listened.signals[name].read() for take in (tom, other))
        assert second == pytest.approx(first, rel=1e-5, abs=1e-6)
    assert other.error_course.rel_mse == pytest.approx(tom.error_course.rel_mse, rel=1e-3)


def test_errors_are_those_over_the_surface(tom):
    resonator, speeds = TOM_MODES.resonator(np.zeros((1, 2))), HARD.speeds(TOM_MODES)
    struck = StruckDrum(resonator, np.zeros(len(TOM_MODES)), speeds, TOM_MODES.scale**2, 0.1, "tom", TOM_MODES.drum)
    players, course = {"model": model_player(LOADED.preset.model)}, tom.error_course
    shares: list[float] = []
    expected = motion_errors(struck, players, RATE_HZ, tom.frames - 1, shares.append)[0].rel_mse["model"]
    assert shares == sorted(shares) and shares[-1] == 1
    assert course.rel_mse == pytest.approx(expected, rel=0.01)
    curve = course.curves["rmse"][: course.ready]
    assert course.ready == course.windows > 5
    assert curve.min() <= np.sqrt(expected) <= curve.max()
    assert np.abs(course.curves["level_db"]).max() < 0.01


def test_another_direction_changes_the_sound_alone(helper):
    job = RenderJob(request_of(TOM), lambda _: LOADED, lambda *_: None, helper)
    take = finish(job)
    before, shown = take.listened, take.motions["truth"].size_m.copy()
    moved = replace(job.request, ear=Ear((0.1, 0.9)))
    assert moved.same_motion(job.request)
    job.ask_again(moved)
    assert finish(job) is take and take.listened is not before
    assert (take.motions["truth"].size_m == shown).all()
    true = true_amplitudes(TOM_MODES, HARD, take.frames - 1)
    for column, point in enumerate((0.1, 0.9)):
        expected = true @ TOM_MODES.radiated((2 * point - 1, 0.0))
        found = take.listened.signals["truth"].read()[:, column]
        assert found == pytest.approx(expected[: len(found)], abs=1e-4 * np.abs(expected).max())


def test_another_blow_is_another_motion():
    asked = request_of(TOM)
    others = (request_of(TOM, 126), request_of(TOM.with_value("knobs.decay", 0.5)), request_of(PLATE), None)
    for other in (*others, replace(asked, seconds=1.0), replace(asked, struck=None)):
        assert not asked.same_motion(other)
    assert asked.same_motion(request_of(TOM))


def test_a_preset_of_one_string_is_refused(helper):
    nylon = Loaded(load_preset(SHIPPED / "studio_nylon_b3.safetensors"))
    with pytest.raises(PresetError, match="many strings"):
        RenderJob(request_of(TOM), lambda _: nylon, lambda *_: None, helper).advance()
