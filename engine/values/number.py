"""A number of a file: finite, and neither text nor truth value."""

from typing import Annotated

from pydantic import AllowInfNan, Strict

Number = Annotated[float, Strict(), AllowInfNan(False)]
