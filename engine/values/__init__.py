"""Values that app and engine share: what a string, a drum or an effect is, as plain numbers within their bounds.

Each is a frozen dataclass that refuses impossible values by name, and needs no NumPy: instruments and settings are
read with them before anything is computed. A string's numbers follow the laws of `kernels.strings`. What else follows
from a value is in `resonators`, `strike`, `effects` and `voices`.

number   a finite number, which is neither text nor truth value
string   a string; its two polarisations; its losses by mode
drum     a membrane or a plate, and the mallet that strikes it
effects  an amplifier and a room
ear      the points where a string is heard, and the pick-up
"""
