"""What averaging over a period knows of modes that share one tension, in closed form and without learning.

`slow_flow`     the averaged Hamiltonian to third order, with the triads and quartets of modes that trade energy
"""

from engine.averaging.slow_flow import slow_flow

__all__ = ["slow_flow"]
