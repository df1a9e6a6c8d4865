"""The shelf: a preset for each shipped string, with what its file says of it, whatever the system's encoding."""

import os
import subprocess
import sys

from engine.presets import STRINGS, find_preset, read_described_string, read_info
from training.family.shelf import TITLES

WRITE = "import sys; from pathlib import Path; from engine.presets import find_preset, load_preset;"
WRITE += "from training.family.shelf import put_on_shelf;"
WRITE += "put_on_shelf(load_preset(find_preset('studio_any_string')), Path(sys.argv[1]))"


def test_descriptions_are_those_of_the_files_where_the_system_has_another_encoding(tmp_path):
    plain = {"LC_ALL": "C", "PYTHONUTF8": "0", "PYTHONCOERCECLOCALE": "0"}  # ASCII where Python leaves it at that
    subprocess.run([sys.executable, "-c", WRITE, str(tmp_path)], env={**os.environ, **plain}, check=True)
    for name, title in TITLES.items():
        string, description = read_described_string(STRINGS / f"{name}.toml")
        info = read_info(tmp_path / f"studio_any_{name}.safetensors")
        assert (info.title, info.string) == (title, string)
        assert info.description == f"{description} Played by the model of every string."
        assert info == read_info(find_preset(f"studio_any_{name}"))
    assert "1140 kg/m³" in read_info(tmp_path / "studio_any_nylon_e4.safetensors").description
