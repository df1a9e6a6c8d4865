"""The rules of the test: a drawn order, answers, and what guessing alone would have reached.

Each trial hides A or B behind X by a fair coin of its own, so that a guesser's number of right answers is binomial.
The number of trials is fixed beforehand: stopping at a lucky moment would make any p-value worthless.
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


def new_seed() -> int:
    """One that nobody knows beforehand."""
    return secrets.randbelow(LARGEST_SEED + 1)


def draw_order(seed: int, trials: int) -> tuple[Identity, ...]:
    """Who hides behind X in each trial. The same seed gives the same order in every version of Python."""
    coin = random.Random(seed)  # of its methods, random() alone is promised never to change
    return tuple("A" if coin.random() < 0.5 else "B" for _ in range(trials))


def p_value(correct: int, trials: int) -> float:
    """The probability that guessing alone gives `correct` right answers or more: one-sided, binomial, exact.

    In integers and not by `scipy.stats`, whose import would let the window stand still for seconds.
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
        x: who was hidden.
        seconds: from the beginning of the trial to the answer.
        auditions: how often A, B or X was chosen or begun again.
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
        auditions: of the present trial.
        x_heard: in the present trial; without it there is nothing to answer.

    Raises:
        ValueError: a value is out of its range, or the step is not possible now.
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
        """Of the present trial, from 1."""
        return len(self.trials) + 1

    def heard_as(self, sound: Sound) -> Identity:
        """What is to be played for a key."""
        return draw_order(self.seed, self.planned)[len(self.trials)] if sound == "X" else sound

    def auditioned(self, sound: Sound) -> Run:
        """A, B or X has been chosen, or begun again."""
        return replace(self, auditions=self.auditions + 1, x_heard=self.x_heard or sound == "X")

    def answered(self, answer: Identity, seconds: float) -> Run:
        """The next trial."""
        if self.complete:
            raise ValueError("The test is complete; there is nothing to answer.")
        if not self.x_heard:
            raise ValueError("X has not been heard in this trial.")
        trial = Trial(x=self.heard_as("X"), answer=answer, seconds=seconds, auditions=self.auditions)
        return Run(self.seed, self.planned, (*self.trials, trial))
