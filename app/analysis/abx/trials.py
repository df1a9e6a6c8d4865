"""The rules of the test: the random order, the answers, and the p-value under guessing.

In each trial X is A or B by an independent fair coin, so that the number of right answers by guessing is binomial.
The number of trials is fixed beforehand, because a test that stops at a lucky moment has no valid p-value.
"""

from __future__ import annotations

import math
import random
from dataclasses import dataclass, replace
from typing import Literal

from pydantic import BaseModel, ConfigDict, Field

from app.shared.value import Value

Identity = Literal["A", "B"]
Sound = Literal["A", "B", "X"]

MOST_TRIALS = 200
LEVEL = 0.05  # below it, luck is an unlikely explanation


class AbxChoices(Value):
    """The last settings. `restart`: each switch starts the sound again."""

    model_config = ConfigDict(extra="ignore")  # earlier versions have more fields

    trials: int = Field(16, ge=1, le=MOST_TRIALS)
    restart: bool = False


def draw_order(seed: int, trials: int) -> tuple[Identity, ...]:
    """Draw for each trial if X is A or B. The same seed gives the same order in every version of Python."""
    coin = random.Random(seed)  # Python guarantees the sequence of random() alone
    return tuple("A" if coin.random() < 0.5 else "B" for _ in range(trials))


def p_value(correct: int, trials: int) -> float:
    """The probability that guessing alone gives `correct` right answers or more: one-sided, binomial, exact.

    Computed in integers, because importing `scipy.stats` would freeze the window for seconds.
    """
    return sum(math.comb(trials, count) for count in range(correct, trials + 1)) / 2**trials


def needed_correct(trials: int, level: float = LEVEL) -> int | None:
    """The fewest right answers with a p-value below `level`; None where not even all of them suffice."""
    return next((correct for correct in range(trials + 1) if p_value(correct, trials) < level), None)


class Trial(BaseModel):
    """An answered trial; `x`: which of the two X was."""

    model_config = ConfigDict(frozen=True)  # versions that kept times have more fields

    x: Identity
    answer: Identity

    @property
    def correct(self) -> bool:
        return self.x == self.answer


@dataclass(frozen=True)
class ListeningTest:
    """A test under way: a value that each step replaces.

    Attributes:
        seed: of the order of X, see `draw_order`.
        planned: number of trials, fixed before the start.
        trials: those that are answered.
        x_heard: whether X has been heard in the present trial; only then can it be answered.
    """

    seed: int
    planned: int
    trials: tuple[Trial, ...] = ()
    x_heard: bool = False

    @property
    def complete(self) -> bool:
        return len(self.trials) == self.planned

    def heard_as(self, sound: Sound) -> Identity:
        """The sound, A or B, that is to be played for a choice of A, B or X."""
        return draw_order(self.seed, self.planned)[len(self.trials)] if sound == "X" else sound

    def auditioned(self, sound: Sound) -> ListeningTest:
        """The run after A, B or X has been heard."""
        return replace(self, x_heard=self.x_heard or sound == "X")

    def answered(self, answer: Identity) -> ListeningTest:
        """The run after an answer, at its next trial.

        Raises:
            ValueError: the test is complete, or X has not been heard in this trial.
        """
        if self.complete or not self.x_heard:
            raise ValueError("The test is complete." if self.complete else "X has not been heard in this trial.")
        return ListeningTest(self.seed, self.planned, (*self.trials, Trial(x=self.heard_as("X"), answer=answer)))
