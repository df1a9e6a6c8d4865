"""The base of checked values that files hold: choices, settings, parts of an instrument, recipes."""

from pydantic import BaseModel, ConfigDict


class Value(BaseModel):
    """Immutable, without unknown fields, with finite numbers."""

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)
