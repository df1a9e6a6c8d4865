"""The coefficients of solver and model, for data and for voices.

The solver's scheme is ABA(8,6,4), see `engine.truth.splitting`; the model is that of `engine.models.koopman_tension`.
"""

# Half of the palindromes: A₁ B₁ A₂ B₂ A₃ B₃ A₄ B₄ A₄ B₃ A₃ B₂ A₂ B₁ A₁, in shares of a sub-step.
_A_HALF = (0.0711334264982231178, 0.241153427956640099, 0.521411761772814789, -0.333698616227678006)
_B_HALF = (0.183083687472197222, 0.310782859898574870, -0.0265646185119588007, 0.0653961422823734185)
ROTATIONS = (*_A_HALF, *reversed(_A_HALF))
KICKS = (*_B_HALF, *reversed(_B_HALF[:3]))

ENERGY_BOUND = 1.5  # of the energy at the start: more is not believed
HARDEST_KICK = 0.3  # of the root of Σ η²κ (q² + v²/ω²) as a string sets out: beyond it nodes come closer
MOST_NODES = 3  # times as many as a soft pluck has
