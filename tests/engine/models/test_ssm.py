"""LRU and S5: the laws, the recurrence that both share, plain recurrences, and their starts."""

from typing import Any, ClassVar

import pytest
import torch

from engine.models.s5 import S5Layer, hippo_normal
from engine.models.ssm import evolve, recur
from tests.engine.models.laws import ModelLaws, relative, released


class StateSpaceLaws(ModelLaws):
    """Laws of both."""

    linear: ClassVar = {"physics": 2e-3}
    unused = frozenset({"first_layer.D"})  # as in the source: counted, not used
    reference = 1e-13

    def stir(self, model: Any, generator: torch.Generator) -> None:
        for block in model.layers:
            for weight in (block.gate.bias, *block.normalization.parameters(), *block.normalization.buffers()):
                if weight.is_floating_point():
                    weight.uniform_(0.5, 1.5, generator=generator)

    def test_training_normalises_over_batch_and_time(self):
        model = self.made().train()
        model(released(), 40).square().mean().backward()
        assert all(block.normalization.running_mean.any() for block in model.layers)
        assert all(tensor.grad is None or tensor.grad.isfinite().all() for tensor in model.parameters())

    @torch.no_grad()
    def test_what_is_folded_for_rendering_follows_the_weights_and_is_kept_in_a_motion(self):
        model = self.stirred()
        first = model(released(), 40)
        _, state = model.advance(model.encode(released()), 21)
        model.layers[1].seq.C.mul_(2.0)
        model.layers[1].normalization.running_mean += 1
        assert relative(model.advance(state, 19)[0], first[:, 21:]) < 1e-5
        rendered = model(released(), 40)
        assert relative(rendered, first) > 1e-3
        with torch.enable_grad():
            plain = model(released(), 40).detach()  # by the definition: nothing is folded
        assert relative(rendered, plain) < 1e-4


class TestLRU(StateSpaceLaws):
    name = "lru"
    count = 636_221
    sizes: ClassVar = {"state_size": 24, "layers": 3}
    too_small: ClassVar = ({"state_size": 8}, "each of the 10 modes")
    reference_sizes: ClassVar = {"grid_points": 11, "state_size": 8, "layers": 2}

    @torch.no_grad()
    def test_its_papers_start_lies_in_the_ring_with_its_gamma(self):
        for block in self.made().layers:
            radius = torch.exp(-block.seq.nu_log.exp())
            assert 0.99 - 1e-6 <= float(radius.min()) <= float(radius.max()) <= 1
            torch.testing.assert_close(block.seq.gamma_log.exp(), torch.sqrt(1 - radius**2), rtol=1e-3, atol=1e-4)


class TestS5(StateSpaceLaws):
    name = "s5"
    count = 307_879
    sizes: ClassVar = {"state_size": 32, "hippo_blocks": 4, "layers": 3}
    too_small: ClassVar = ({"state_size": 16}, "each of the 10 modes")
    reference_sizes: ClassVar = {"grid_points": 11, "state_size": 16, "hippo_blocks": 1, "layers": 2}
    stable = False

    @torch.no_grad()
    def test_its_papers_start_is_hippo_in_blocks_with_steps_in_range(self):
        for block in self.made().layers:
            seq = block.seq
            torch.testing.assert_close(seq.Lambda_im, hippo_normal(8)[0].imag[:4].repeat(4).float())
            assert (seq.Lambda_re == -0.5).all()
            assert 0.0001 <= float(seq.log_step.exp().min()) < float(seq.log_step.exp().max()) <= 0.1
        # its code counts the outputs in the fan-in: parts of variance 1/fan_in each; half of V's columns keep it
        for how, fan_in, smallest in (("paper", 128 * 101, 1e-4), ("physics", 128, 1e-3)):
            layer = S5Layer(64, 101, 16)
            layer.initialise(how, torch.Generator().manual_seed(0))
            assert float(layer.C.square().mean()) * fan_in == pytest.approx(1, rel=0.05)
            assert float(layer.log_step.exp().min()) == pytest.approx(smallest, rel=0.5)

    @torch.no_grad()
    def test_an_eigenvalue_outside_is_reported_with_its_pair_and_its_state_is_whole_blocks(self):
        model = self.made()
        model.layers[1].seq.Lambda_re[2] = 0.3
        assert int((torch.cat(model.log_eigenvalues()).real > 0).sum()) == 2
        with pytest.raises(ValueError, match="state_size must be a multiple of twice the 16 hippo_blocks, not 100"):
            self.made(state_size=100, hippo_blocks=16)


def test_hippo_is_normal_up_to_its_rank_one_part():
    """A_nk = -√(2n+1)√(2k+1) below the diagonal, -(n+1) on it; plus p pᵀ with p_n = √(n+½) it is normal."""
    n = torch.arange(8, dtype=torch.float64)
    root = torch.sqrt(2 * n + 1)
    legs = -torch.tril(torch.outer(root, root), -1) - torch.diag(n + 1)
    normal = legs + torch.outer(torch.sqrt(n + 0.5), torch.sqrt(n + 0.5))
    rates, vectors = hippo_normal(8)
    torch.testing.assert_close(vectors @ torch.diag(rates) @ vectors.mH, normal.to(rates), rtol=0, atol=1e-12)
    torch.testing.assert_close(rates[:4].conj().resolve_conj(), rates[4:].flip(0), rtol=0, atol=1e-12)


@pytest.mark.parametrize("steps", [1, 34])
def test_the_adjoint_is_the_derivative(steps):
    generator, log_eigenvalue = torch.Generator().manual_seed(3), torch.tensor([-0.07 + 1.7j], dtype=torch.complex128)
    driven = torch.randn(steps, 2, 1, dtype=torch.complex128, generator=generator)
    inputs = tuple(tensor.clone().requires_grad_() for tensor in (driven, log_eigenvalue, driven[0]))
    assert torch.autograd.gradcheck(recur, inputs)
    assert torch.autograd.gradcheck(lambda a, x: evolve(a, x, steps, torch.complex128), inputs[1:])


def test_phases_of_both_stay_exact_after_a_million_steps():
    log_eigenvalues = torch.tensor([-1e-7 + 0.3j, -1e-8 + 3.1j], dtype=torch.complex128)
    state, done = torch.ones(1, 2, dtype=torch.complex128), 0
    for steps in (1000, 1, 997, 2) * 500:
        _, state = evolve(log_eigenvalues, state, steps, torch.complex64)
        done += steps
    phase = torch.remainder(done * log_eigenvalues.imag, 2 * torch.pi)
    expected = torch.polar(torch.exp(done * log_eigenvalues.real), phase)
    torch.testing.assert_close(state[0], expected, rtol=0, atol=1e-8)
