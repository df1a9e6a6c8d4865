"""The rules of the test: the random order, the answers, and the p-value under guessing.

In each trial X is A or B by an independent fair coin, so that the number of right answers by guessing is binomial.
The number of trials is fixed beforehand, because a test that stops at a lucky moment has no valid p-value.
"""

from __future__ import annotations

import math
import random
import secrets
from dataclasses import dataclass, replace
from typing import Annotated, Literal

from pydantic import BaseModel, ConfigDict, Field

Identity = Literal["A", "B"]
Sound = Literal["A", "B", "X"]

USUAL_TRIALS = (10, 16, 25)
MOST_TRIALS = 200
LARGEST_SEED = 2**32 - 1
LEVEL = 0.05  # below it, luck is an unlikely explanation


class AbxChoices(BaseModel):
    """The last settings. `restart`: each switch starts the sound again; `folder`: "" for `record.default_folder`."""

    model_config = ConfigDict(extra="forbid")

    trials: int = Field(16, ge=1, le=MOST_TRIALS)
    restart: bool = False
    folder: str = ""


def new_seed() -> int:
    """A seed that cannot be foreseen, 0 … `LARGEST_SEED`."""
    return secrets.randbelow(LARGEST_SEED + 1)


def draw_order(seed: int, trials: int) -> tuple[Identity, ...]:
    """Whether X is A or B in each trial. The same seed gives the same order in every version of Python."""
    coin = random.Random(seed)  # Python guarantees the sequence of random() alone
    return tuple("A" if coin.random() < 0.5 else "B" for _ in range(trials))


def p_value(correct: int, trials: int) -> float:
    """The probability that guessing alone gives `correct` right answers or more: one-sided, binomial, exact.

    Computed in integers, because importing `scipy.stats` would freeze the window for seconds.

    Raises:
        ValueError: `correct` does not lie in 0 … `trials`.
    """
    if not 0 <= correct <= trials:
        raise ValueError(f"{correct} of {trials} answers cannot be right")
    return sum(math.comb(trials, count) for count in range(correct, trials + 1)) / 2**trials


def needed_correct(trials: int, level: float = LEVEL) -> int | None:
    """The fewest right answers with a p-value below `level`; None where not even all of them suffice."""
    return next((correct for correct in range(trials + 1) if p_value(correct, trials) < level), None)


class Trial(BaseModel):
    """One trial that has been answered.

    Attributes:
        x: which of the two X was.
        seconds: from the beginning of the trial to the answer.
        auditions: how often A, B or X was chosen or restarted.
    """

    model_config = ConfigDict(frozen=True, extra="forbid")

    x: Identity
    answer: Identity
    seconds: Annotated[float, Field(ge=0, allow_inf_nan=False)]
    auditions: Annotated[int, Field(ge=1)]

    @property
    def correct(self) -> bool:
        return self.x == self.answer


@dataclass(frozen=True)
class Run:
    """A test under way: a value that each step replaces.

    Attributes:
        planned: number of trials, fixed before the start.
        trials: those that are answered.
        auditions: of the present trial, so far.
        x_heard: whether X has been heard in the present trial; only then can it be answered.

    Raises:
        ValueError: a value is out of its range.
    """

    seed: int
    planned: int
    trials: tuple[Trial, ...] = ()
    auditions: int = 0
    x_heard: bool = False

    def __post_init__(self) -> None:
        if not 1 <= self.planned <= MOST_TRIALS:
            raise ValueError(f"a test has 1 … {MOST_TRIALS} trials, not {self.planned}")
        if not 0 <= self.seed <= LARGEST_SEED:
            raise ValueError(f"a seed lies in 0 … {LARGEST_SEED}, not {self.seed}")

    @property
    def complete(self) -> bool:
        return len(self.trials) == self.planned

    @property
    def number(self) -> int:
        """The number of the present trial, from 1."""
        return len(self.trials) + 1

    def heard_as(self, sound: Sound) -> Identity:
        """Whether A or B is to be played for a choice of A, B or X."""
        return draw_order(self.seed, self.planned)[len(self.trials)] if sound == "X" else sound

    def auditioned(self, sound: Sound) -> Run:
        """The run after A, B or X has been chosen or restarted."""
        return replace(self, auditions=self.auditions + 1, x_heard=self.x_heard or sound == "X")

    def answered(self, answer: Identity, seconds: float) -> Run:
        """The run after an answer, at its next trial.

        Raises:
            ValueError: the test is complete, or X has not been heard in this trial.
        """
        if self.complete:
            raise ValueError("The test is complete; there is nothing to answer.")
        if not self.x_heard:
            raise ValueError("X has not been heard in this trial.")
        trial = Trial(x=self.heard_as("X"), answer=answer, seconds=seconds, auditions=self.auditions)
        return Run(self.seed, self.planned, (*self.trials, trial))
