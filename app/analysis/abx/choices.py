"""The last settings of the listening test."""

from __future__ import annotations

from pydantic import BaseModel, ConfigDict, Field

from app.analysis.abx.trials import MOST_TRIALS


class AbxChoices(BaseModel):
    """The last settings. `restart`: each switch starts the sound anew; `folder`: "" for `record.default_folder`."""

    model_config = ConfigDict(extra="forbid")

    trials: int = Field(16, ge=1, le=MOST_TRIALS)
    restart: bool = False
    folder: str = ""
