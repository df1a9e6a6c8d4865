"""What commands print: the texts of `golden/`, word for word; numbers may differ in their last digits.

A line of a text that begins with `$` is a command; `LEARNED_STRINGS_GOLDEN=write` writes what follows it again.
"""

import os
import re
from pathlib import Path

import pytest

from engine.presets import SHIPPED, preset_digest
from training.heard_file import Heard, add_heard

OF_A_VERSION = re.compile(r"[ \"]*(version|preset.sha256)")
NUMBER = re.compile(r"-?\d[\d,]*\.?\d*(?:e[+-]?\d+)?")


def plain(text: str, *places: Path) -> str:
    """A text in which folders, versions, durations and widths of columns are no more."""
    for place in places:
        text = text.replace(str(place), "PLACE")
    text = re.sub(r" in +[\d.]+ (?:ms|s|min)\b", "", text)
    lines = (re.sub(r"[ ─]{2,}", "  ", line).rstrip() for line in text.splitlines())
    return "\n".join(line for line in lines if line and not OF_A_VERSION.match(line)) + "\n"


@pytest.mark.parametrize("file", sorted(Path(__file__).with_name("golden").glob("*.txt")), ids=lambda file: file.stem)
def test_a_command_prints_its_golden_text(run, file, folder, request):
    wanted = file.read_text(encoding="utf-8")
    if "good" in wanted:
        installed = request.getfixturevalue("installed")
        (installed / "broken.safetensors").write_bytes(b"not a preset")
        digest = preset_digest(installed / "good.safetensors")
        add_heard(installed, [Heard("good", digest, 4.0, 9.0, 5.2, 3.0, 13.0)])
    printed = []
    for line in re.findall(r"(?m)^\$ (.*) → \d+$", wanted):
        done = run(line)
        printed += [f"$ {line} → {done.status}\n", done.out, done.err]
    found = plain("".join(printed), folder, folder.parent, SHIPPED)
    if os.environ.get("LEARNED_STRINGS_GOLDEN") == "write":
        file.write_text(found, encoding="utf-8")
        wanted = found
    assert NUMBER.sub("0", found) == NUMBER.sub("0", wanted)
    numbers = [[float(each.replace(",", "")) for each in NUMBER.findall(text)] for text in (found, wanted)]
    assert numbers[0] == pytest.approx(numbers[1], rel=2e-3)
