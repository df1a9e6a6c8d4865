"""Two polarisations: their modes, their truth against DOP853, the model against the truth, two-stage decay."""

from __future__ import annotations

import numpy as np
import torch

from engine.kernels import strings
from engine.kernels.constants import MOST_PAIRS
from engine.models.base import Physics
from engine.models.koopman_tension import KoopmanTension
from engine.pluck import Pluck
from engine.presets import load_preset
from engine.presets.finding import SHIPPED
from engine.resonators.base import Resonator
from engine.resonators.string import resonator_of
from engine.truth import ModalState
from engine.truth.oracle import solve_dop853
from engine.truth.splitting import SplittingSolver
from engine.values.string import Polarisations, StringParameters
from tests.engine.sounds import relative

STRING = StringParameters()
MOVING = Polarisations(angle_deg=40, second_heard=0.25, second_cents=2.0, conductance_s_kg=0.02)
PLUCK = Pluck(0.17, 3.0, "rounded", 0.08)


def polarised(moving: Polarisations, string: StringParameters, partials: int, decay: float = 1.0) -> Resonator:
    """Pairs of modes, then single ones; `decay`: of the bridge's conductances."""
    law, pairs = resonator_of(string, partials), min(MOST_PAIRS, partials)
    modes = range(partials + pairs)
    partial = [strings.partial_of(mode, pairs) - 1 for mode in modes]
    direction = [strings.direction_of(mode, pairs) for mode in modes]
    conductances = decay * moving.conductance_s_kg, decay * moving.second_conductance_s_kg
    rows = np.empty(4 * len(modes))
    strings.rows(string.row, len(modes), pairs, moving.detuning, conductances, (0.0, 0.0, 0.0), rows)
    squares, sigma, coupling, stretch = rows.reshape(4, -1)
    pulled, heard = (np.array(each)[direction] for each in (moving.pulled, moving.heard))
    pulled[2 * pairs :] = 1 / moving.heard[0]  # so that it is heard as the others are
    assert law.end_force is not None and law.analysis is not None
    return Resonator(
        omega=np.sqrt(squares),
        sigma=sigma,
        coupling=coupling,
        stretch=stretch,
        tension_rise=law.tension_rise,
        shapes=law.shapes[partial] * heard[:, None],
        analysis=law.analysis[:, partial] * pulled,
        end_force=law.end_force[partial] * heard,
    )


def test_a_pluck_is_heard_as_high_as_it_is_pulled() -> None:
    resonator, law = polarised(MOVING, STRING, 60), resonator_of(STRING, 60)
    displacement = PLUCK.displacement(101)
    heard = resonator.to_grid(resonator.to_modes(displacement))
    np.testing.assert_allclose(heard, law.to_grid(law.to_modes(displacement)), atol=1e-12)
    assert resonator.force_weights is not None and law.force_weights is not None
    np.testing.assert_allclose(resonator.force_weights, law.force_weights)


def test_without_an_angle_it_moves_as_one_string() -> None:
    plain = Polarisations(0.0, 0.0, 0.0, 0.0, 0.0)
    state = ModalState.at_rest(polarised(plain, STRING, 30).to_modes(PLUCK.displacement(101))[None])
    paired = polarised(plain, STRING, 30)
    found = SplittingSolver(paired, 48_000).solve(state, 400) @ paired.shapes
    law = resonator_of(STRING, 30)
    alone = SplittingSolver(law, 48_000).solve(ModalState.at_rest(law.to_modes(PLUCK.displacement(101))[None]), 400)
    np.testing.assert_allclose(found, alone @ law.shapes, rtol=1e-9, atol=1e-12)


def test_both_share_one_tension_in_the_truth_and_in_the_learned_curves() -> None:
    """Against DOP853, at velocities that glide by a quarter-tone; the model as accurate as in one direction."""
    resonator, rate_hz = polarised(MOVING, STRING, 12), 48_000
    q = resonator.to_modes(Pluck(0.17, 8.0, "rounded", 0.2).displacement(101))[None]
    assert float(resonator.relative_tension_rise(q[0])) > 0.02
    state = ModalState(q, q[:, ::-1].copy())
    found, expected = (
        SplittingSolver(resonator, rate_hz).solve(state, 1_000),
        solve_dop853(resonator, state, rate_hz, 1_000),
    )
    assert relative(found, expected) < 1e-7
    model = load_preset(SHIPPED / "studio_any_string.safetensors").model
    assert isinstance(model, KoopmanTension)
    wide = polarised(MOVING, STRING, 60)
    heard = wide.shapes @ np.linspace(0, 1, 101)[:, None]
    for amplitude_mm in (1.0, 6.0):
        displacement = PLUCK.moved(amplitude_mm=amplitude_mm).displacement(101)[None]
        tuned = model.for_resonator(Physics(wide, rate_hz, 1.0))
        moved = tuned.amplitudes(tuned.encode(torch.from_numpy(displacement)), rate_hz // 4).detach().numpy()
        true, _ = SplittingSolver(wide, rate_hz).advance(
            ModalState.at_rest(wide.to_modes(displacement)), rate_hz // 4
        )
        assert relative(moved @ heard, true @ heard) ** 2 < 1e-6
