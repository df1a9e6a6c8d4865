"""What notes are given in tests: monitors, and the shipped presets."""

from app.presets.library import PresetEntry
from app.session.monitor import Monitor
from engine.presets import SHIPPED, read_info


def hears(source: str, beside: str = "", level_match: bool = False, difference_gain_db: float = 0.0) -> Monitor:
    """A monitor with a source that is heard; beside it, unless given, the truth, or beside that the model."""
    beside = beside or ("model" if source == "truth" else "truth")
    return Monitor(a=source, b=beside, level_match=level_match, difference_gain_db=difference_gain_db)


def find_shipped(name: str) -> PresetEntry | None:
    """A shipped preset by its name."""
    path = SHIPPED / f"{name}.safetensors"
    return PresetEntry(name, path, read_info(path), 0) if path.is_file() else None
