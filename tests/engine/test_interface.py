"""What a notebook uses: README's example runs, and the names that `engine` lists are there."""

import re
import subprocess
import sys
from pathlib import Path

import pytest
import soundfile

import engine

ROOT = Path(__file__).parents[2]


def test_the_example_of_the_readme_runs(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys) -> None:
    section = (ROOT / "README.md").read_text(encoding="utf-8").split("## From Python")[1].split("\n## ")[0]
    (example,) = re.findall(r"```python\n(.*?)```", section, re.DOTALL)
    assert len(example.strip().splitlines()) < 25
    monkeypatch.chdir(tmp_path)
    exec(compile(example, "README.md", "exec"), {})
    assert re.fullmatch(r"relative MAE [\d.e-]+\n", capsys.readouterr().out)
    sound, rate_hz = soundfile.read(tmp_path / "pluck.wav")
    assert (rate_hz, len(sound)) == (44_100, 88_200)
    assert 0.01 < abs(sound).max() <= 1


def test_every_name_is_there() -> None:
    for name in engine.__all__:
        assert getattr(engine, name).__name__ == name
    with pytest.raises(AttributeError, match="no attribute 'nothing'"):
        engine.nothing  # noqa: B018


@pytest.mark.parametrize(
    ("module", "unloaded"), [("engine", {"torch", "numpy", "numba"}), ("engine.effects", {"torch", "numba"})]
)
def test_the_engine_itself_loads_nothing_and_effects_no_compiler(module: str, unloaded: set[str]) -> None:
    code = f"import sys, {module}; assert not {unloaded} & set(sys.modules)"
    subprocess.run([sys.executable, "-c", code], check=True, cwd=ROOT)
