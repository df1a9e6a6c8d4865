"""What commands print: the text of `golden/`, word for word; numbers may differ in their last digits.

`LEARNED_STRINGS_GOLDEN=write` writes the texts again.
"""

from __future__ import annotations

import os
import re
from pathlib import Path
from typing import Any

import pytest

from engine.presets import preset_digest
from tests.app.commands.conftest import Run
from training.heard_file import Heard, add_heard

GOLDEN = Path(__file__).with_name("golden")
NUMBER = re.compile(r"-?\d[\d,]*\.?\d*(?:e[+-]?\d+)?")
PLUCK = "--position 0.1 --amplitude-mm 3 --seconds 0.2"
LINES = {  # of each text; `$` begins another line
    "presets": "presets $ presets --json",
    "models": "models",
    "render": f"render good {{out}}.wav {PLUCK} --listen-right 0.6 $ info {{out}}.wav",
    "compare": f"compare good {PLUCK} --width 0.3",
    "evaluate": "evaluate {tiny} --split both --past 1",
    "drum": "drums modes thin_bars --key 72 --count 3",
    "size": "sampled mandolin {out}.sfz --keys 60-62 --layers 2 --seconds 0.2 --size-only",
    "plan": "sweep {made:plan.toml} --dry-run --results {out}.csv",
}


def plain(text: str, places: dict[str, Any]) -> str:
    """A text in which folders, versions and widths of columns are no more."""
    for place in (places["folder"], places["folder"].parent):
        text = text.replace(str(place), "PLACE")
    lines = (re.sub(r"[ ─]{2,}", "  ", line).rstrip() for line in text.splitlines())
    return "\n".join(line for line in lines if line and not line.startswith(("version", "preset sha256"))) + "\n"


@pytest.mark.parametrize("name", LINES)
def test_a_command_prints_its_golden_text(
    run: Run, name: str, places: dict[str, Any], request: pytest.FixtureRequest
) -> None:
    if name in ("presets", "render", "compare"):
        shipped = request.getfixturevalue("installed")
        (shipped / "broken.safetensors").write_bytes(b"not a preset")
        digest = preset_digest(shipped / "good.safetensors")
        add_heard(shipped, [Heard("good", digest, 4.0, 9.0, 5.2, 3.0, 13.0)])
    printed = []
    for line in LINES[name].split(" $ "):
        done = run(*(word.format_map(places) for word in line.split()))
        printed += [f"$ {line} → {done.status}\n", done.out, done.err]
    found, path = plain("".join(printed), places), GOLDEN / f"{name}.txt"
    if os.environ.get("LEARNED_STRINGS_GOLDEN") == "write":
        path.write_text(found, encoding="utf-8")
    wanted = path.read_text(encoding="utf-8")
    assert NUMBER.sub("0", found) == NUMBER.sub("0", wanted)
    numbers = [[float(each.replace(",", "")) for each in NUMBER.findall(text)] for text in (found, wanted)]
    assert numbers[0] == pytest.approx(numbers[1], rel=2e-3)
