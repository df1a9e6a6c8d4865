"""The coefficients of the fast solver, for data and for voices: ABA(8,6,4), see `engine.truth.splitting`."""

# Half of the palindromes: A₁ B₁ A₂ B₂ A₃ B₃ A₄ B₄ A₄ B₃ A₃ B₂ A₂ B₁ A₁, in shares of a sub-step.
_A_HALF = (0.0711334264982231178, 0.241153427956640099, 0.521411761772814789, -0.333698616227678006)
_B_HALF = (0.183083687472197222, 0.310782859898574870, -0.0265646185119588007, 0.0653961422823734185)
ROTATIONS = (*_A_HALF, *reversed(_A_HALF))
KICKS = (*_B_HALF, *reversed(_B_HALF[:3]))
