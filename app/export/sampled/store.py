"""The folder of samples, and its index of what each was rendered from, with which a stopped export continues."""

from __future__ import annotations

import contextlib
import hashlib
import re
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import partial
from pathlib import Path

from filelock import FileLock, Timeout
from pydantic import BaseModel, ConfigDict, Field

from app.export.sampled.plan import NoteRenderer, SampledPlan, Zone
from app.export.sampled.sample import INAUDIBLE_DBFS, PEAK_DBFS, encoded, sample_of
from app.shared.worker import Progress
from engine import bounds
from engine.plain_text import one_line
from engine.read_file import UnusableFile, read_bounded
from engine.result_file import WriteError, explain, whole_file
from engine.schema import parse_json

INDEX = "index.json"
LOCK = ".index.lock"
LARGEST_INDEX_BYTES = 8 * 2**20  # of every key at the most layers: 2 MiB
_OURS = re.compile(r"key\d{3}_vel\d{3}\.(flac|wav)")
_DIGEST = Field(pattern="^[0-9a-f]{64}$")


class StoredSample(BaseModel):
    """A file of the folder.

    Attributes:
        made_from: digest of all that decides how it sounds (`SampledPlan.digest`).
        sha256: of the file.
        gain_db, level_db, cut: as in `Sample`.
    """

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)

    made_from: str = _DIGEST
    sha256: str = _DIGEST
    frames: int = Field(ge=1, le=bounds.MOST_FRAMES)
    channels: int = Field(ge=1, le=2)
    gain_db: float = Field(ge=-200, le=200)
    level_db: float = Field(ge=-200, le=200)
    cut: bool = False

    @property
    def peak_db(self) -> float:
        """Of the note as rendered, relative to full scale."""
        return PEAK_DBFS - self.gain_db if self.level_db > INAUDIBLE_DBFS else INAUDIBLE_DBFS


class SampleIndex(BaseModel):
    """What a folder of samples holds, by file name, and the name of the file that plays them."""

    model_config = ConfigDict(extra="forbid")

    format: int = Field(1, ge=1, le=1)
    instrument: str = Field(max_length=255)
    samples: dict[str, StoredSample] = {}


class SampleStore:
    """The samples of one instrument file, in a folder of their own beside it.

    Raises:
        WriteError: the folder cannot be made, or holds something else.
    """

    def __init__(self, folder: Path, instrument: str) -> None:
        self.folder = folder
        try:
            folder.mkdir(parents=True, exist_ok=True)
            others = any(not path.name.startswith(".") for path in folder.iterdir())  # a lock, or a file cut short
        except OSError as error:
            raise WriteError(explain(folder, error)) from error
        found = read_index(folder / INDEX)
        if found is None and others:
            raise WriteError(f"{folder}: holds other files; remove it, or choose another name for {instrument}")
        if found is not None and found.instrument != instrument:
            raise WriteError(
                f"{folder}: holds the samples of {one_line(found.instrument)}; choose another name for {instrument}"
            )
        self._index = found or SampleIndex(instrument=instrument)

    @contextmanager
    def locked(self) -> Iterator[None]:
        """Within, no other export writes here. Raises WriteError where one does."""
        lock = FileLock(self.folder / LOCK, timeout=0)
        try:
            lock.acquire()
        except Timeout:
            raise WriteError(f"{self.folder}: another export writes there; wait for its end") from None
        except OSError as error:
            raise WriteError(explain(self.folder, error)) from error
        try:
            yield
        finally:
            lock.release()

    @property
    def empty(self) -> bool:
        return not self._index.samples

    def path(self, name: str) -> Path:
        return self.folder / name

    def fill(
        self, plan: SampledPlan, render: NoteRenderer, progress: Progress = lambda *_: None
    ) -> tuple[dict[Zone, StoredSample], int]:
        """Renders what is not there yet; samples that the plan does not hold are removed.

        Returns:
            What the folder holds, by zone, and how many of them were rendered now.

        Raises:
            Cancelled: `progress` raised it; whole files and the index stay.
            WriteError: a file cannot be written, or a note is not finite.
        """
        self._write_index()  # before any sample: it says whose they are
        wanted = []
        for zone in plan.zones:
            progress(0.0, "checking samples")
            if not self._keeps(plan, zone):
                wanted.append(zone)
        started = time.monotonic()
        for done, zone in enumerate(wanted):
            share, text = done / len(wanted), f"key {zone.key}, velocity {zone.velocity}"
            if done == 1:
                started = time.monotonic()  # the first note also loads and compiles
            left_s = (time.monotonic() - started) * (len(wanted) - done) / (done - 1) if done > 1 else None
            report = partial(progress, share, text, left_s)
            report()
            self._add(plan, zone, render, report)
        self._remove_all_but({plan.file_name(zone) for zone in plan.zones})
        return {zone: self._index.samples[plan.file_name(zone)] for zone in plan.zones}, len(wanted)

    def remove(self) -> None:
        """Deletes the samples and the index, and the folder if nothing else is in it; errors are ignored."""
        with contextlib.suppress(OSError, WriteError):
            self._remove_all_but(set())
            (self.folder / INDEX).unlink(missing_ok=True)
            (self.folder / LOCK).unlink(missing_ok=True)
            self.folder.rmdir()

    def _keeps(self, plan: SampledPlan, zone: Zone) -> bool:
        name = plan.file_name(zone)
        entry = self._index.samples.get(name)
        if entry is None or entry.made_from != plan.digest(zone):
            return False
        try:
            with self.path(name).open("rb") as file:
                return hashlib.file_digest(file, "sha256").hexdigest() == entry.sha256
        except OSError:
            return False

    def _add(self, plan: SampledPlan, zone: Zone, render: NoteRenderer, check: Callable[[], None]) -> None:
        name = plan.file_name(zone)
        try:
            note = (plan.patch, zone.key, zone.velocity, plan.seconds, plan.seconds, plan.rate_hz)
            sample = sample_of(render(*note, advanced=lambda seconds: check()), plan.rate_hz)
        except ValueError as error:
            raise WriteError(f"{self.path(name)}: {error}") from error
        data = encoded(sample, plan.rate_hz, plan.format, plan.bits)
        self._index.samples.pop(name, None)
        self._write(name, data)
        self._index.samples[name] = StoredSample(
            made_from=plan.digest(zone),
            sha256=hashlib.sha256(data).hexdigest(),
            frames=len(sample.sound),
            channels=sample.sound.shape[1],
            gain_db=sample.gain_db,
            level_db=round(sample.level_db, 3),
            cut=sample.cut,
        )
        self._write_index()

    def _remove_all_but(self, names: set[str]) -> None:
        left = {name for name in self._index.samples if name not in names and _OURS.fullmatch(name)}
        for name in left:
            try:
                self.path(name).unlink(missing_ok=True)
            except OSError as error:  # a sampler has it open
                raise WriteError(explain(self.path(name), error)) from error
        if left:
            self._index.samples = {n: entry for n, entry in self._index.samples.items() if n in names}
            self._write_index()

    def _write_index(self) -> None:
        self._index.samples = dict(sorted(self._index.samples.items()))
        self._write(INDEX, self._index.model_dump_json(indent=1).encode())

    def _write(self, name: str, data: bytes) -> None:
        with whole_file(self.path(name)) as file:
            file.write(data)


def read_index(path: Path) -> SampleIndex | None:
    """The index; None where there is no file.

    Raises:
        WriteError: there is one that is not the index of samples, or one of another version.
    """
    try:
        raw = read_bounded(path, LARGEST_INDEX_BYTES)
        return SampleIndex.model_validate(parse_json(raw, str(path), LARGEST_INDEX_BYTES))
    except FileNotFoundError:
        return None
    except UnusableFile as error:
        raise WriteError(f"{path}: {error.strerror}; remove it, or choose another name") from error
    except OSError as error:
        raise WriteError(explain(path, error)) from error
    except (ValueError, OverflowError) as error:
        raise WriteError(
            f"{path}: no index of samples that this version reads; remove its folder, or choose another name"
        ) from error
