"""The truth: exact and numerical solutions of the string that the models learn.

`splitting`  the fast solver, linear or tension-modulated, streaming
`oracle`     SciPy's DOP853 at the paper's tolerances, slow: what the fast solver is checked against
"""

from engine.truth.oracle import solve_dop853
from engine.truth.splitting import ModalState, SplittingSolver, default_substeps

__all__ = ["ModalState", "SplittingSolver", "default_substeps", "solve_dop853"]
