"""The listener: where and how the string is heard."""

from __future__ import annotations

from pydantic import Field

from app.instruments.fields import parameter
from app.instruments.instrument import Instrument, Pickup
from app.shared.value import Value
from engine.values.ear import Ear
from engine.values.ear import Pickup as PickupKind

HIGHEST_MODE = 9_999  # of any grid that a preset may have
RIGHT_POINT = "pickup.points.1"  # of an instrument in stereo


class Listener(Value):
    """Listening points, pick-up and soloed mode.

    Attributes:
        listen: as a fraction of the string's length; in stereo the left point.
        listen_right: used in stereo.
        solo: above 0: this mode is heard alone.
    """

    listen: float = parameter("listen")
    listen_right: float = parameter("listen_right")
    stereo: bool = False
    pickup: PickupKind = "displacement"
    solo: int = Field(0, ge=0, le=HIGHEST_MODE)

    @property
    def points(self) -> tuple[float, ...]:
        """The listening points, one a channel."""
        return (self.listen, self.listen_right) if self.stereo else (self.listen,)

    @property
    def ear(self) -> Ear:
        """The ear as the engine takes it; the first point, in stereo the left, is drawn."""
        return Ear(self.points, self.pickup, self.solo)

    def picked_up(self, instrument: Instrument) -> Instrument:
        """The instrument with this pick-up.

        Raises:
            ValueError: in mono one of its macros would have nothing to move.
        """
        pickup = instrument.pickup.model_copy(update={"points": self.points, "kind": self.pickup})
        if pickup == instrument.pickup:
            return instrument
        if not self.stereo:
            for macro in instrument.macros:
                if any(target.field == RIGHT_POINT for target in macro.targets):
                    reason = f"its macro {macro.name} moves the right listening point"
                    raise ValueError(f"{instrument.name} stays in stereo: {reason}")
        return instrument.model_copy(update={"pickup": pickup})


def points_of(pickup: Pickup) -> dict[str, object]:
    """The fields of `Listener` that an instrument's pick-up says."""
    right = {"listen_right": pickup.points[1]} if len(pickup.points) > 1 else {}
    return {"listen": pickup.points[0], "stereo": len(pickup.points) > 1, "pickup": pickup.kind, **right}
