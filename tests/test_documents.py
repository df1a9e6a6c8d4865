"""What the documents show is there: links, commands and their options, tables, examples, notebooks, sizes."""

import json
import re
import shlex
from collections.abc import Iterator
from functools import cache
from pathlib import Path
from typing import Any

import matplotlib
import pytest
import torch
import typer

from app.commands.cli import cli
from app.instruments.instrument import Instrument
from bench.cli import bench, main
from engine.models.base import Physics
from engine.resonators.string import resonator_of
from engine.values.string import StringParameters
from training.cell import load
from training.results import RESULTS, read_results
from training.tables.compact import as_compact

ROOT = Path(__file__).parents[1]
DOCUMENTS = sorted([*ROOT.glob("*.md"), *ROOT.glob("docs/*.md")])
NOTEBOOKS = sorted(ROOT.glob("docs/notebooks/*.ipynb"))
GENERATED = {"command-line.md", "presets.md", "api.md"}  # pages of the site, see docs/site_pages.py


def text(name: str) -> str:
    return (ROOT / name).read_text("utf-8")


@pytest.mark.parametrize("path", DOCUMENTS, ids=lambda path: path.name)
def test_links_lead_somewhere(path):
    links = re.findall(r"\]\(([^)#\s]+)", path.read_text("utf-8"))
    local = [link for link in links if "://" not in link and link not in GENERATED]
    assert [link for link in local if not (path.parent / link).exists()] == []


@pytest.mark.parametrize(
    ("name", "lines"), [("README.md", 120), ("RESULTS.md", 200), ("CHANGELOG.md", 60), ("docs/many-strings.md", 160)]
)
def test_documents_are_short(name, lines):
    assert len(text(name).splitlines()) <= lines


def test_sounds_and_pictures_are_small():
    sounds, pictures = (ROOT / "docs" / name for name in ("sounds", "images"))
    assert sum(path.stat().st_size for path in sounds.iterdir() if path.is_file()) < 1.5e6
    assert all(path.stat().st_size < 6e5 for path in pictures.iterdir() if path.is_file())


@cache
def program() -> Any:
    return typer.main.get_command(cli)


def commands() -> Iterator[tuple[str, list[str]]]:
    """The command lines of all documents: where, and their words after the program's name."""
    for path in DOCUMENTS:
        for line in path.read_text("utf-8").splitlines():
            if line.startswith("python3 run.py -- "):
                yield path.name, shlex.split(line.removeprefix("python3 run.py -- "), comments=True)
            for words in re.findall(r"`([^`]+)`", line):  # within a sentence, the beginning may be left out
                first, _, others = words.removeprefix("python3 run.py -- ").partition(" ")
                if others and first in program().commands:
                    yield path.name, shlex.split(f"{first} {others}")


def test_commands_and_their_options_and_presets_exist():
    found = list(commands())
    assert len(found) > 20
    there = {path.stem for path in (ROOT / "presets").rglob("*") if path.suffix in (".safetensors", ".toml")}
    for where, words in found:
        if words[0] in ("render", "compare", "predict"):
            assert {word for word in words if re.match(r"(nylon|studio)_\w+$", word)} <= there, where
        command = program()
        while words and hasattr(command, "commands"):
            assert words[0] in command.commands, f"{where}: no command {words[0]!r}"
            command = command.commands[words.pop(0)]
        options = {option for each in command.params for option in each.opts} | {"--help"}
        used = [word for word in words if word.startswith("--")]
        assert not set(used) - options, f"{where}: {command.name} has no option {set(used) - options}"


def test_every_benchmark_parses_its_options_and_the_documents_name_no_other(capsys):
    commands: dict[str, Any] = typer.main.get_command(bench).commands
    for name in commands:
        assert main([name, "--help"]) == 0
        assert f"run.py bench {name}" in capsys.readouterr().out
        assert main([name, "--no-such-option"]) == 2
    lines = [
        line
        for path in DOCUMENTS
        for line in re.findall(r"(?:run\.py |`)bench ([a-z][^`\n#]*)", path.read_text("utf-8"))
    ]
    lines += re.findall(r"\| `([a-z]+)`[^|\n]*\|$", text("docs/benchmarks.md").partition("## Measured")[2], re.M)
    assert len(lines) > 20
    for line in lines:
        name, *words = shlex.split(line)
        assert name in commands, line
        options = {option for each in commands[name].params for option in each.opts}
        assert {word for word in words if word.startswith("--")} <= options, line
    assert set(commands) <= {shlex.split(line)[0] for line in lines}, "each benchmark's use is in a document"


def test_results_hold_the_tables_of_the_rows():
    tables = text("RESULTS.md").partition("<!-- tables -->\n\n")[2]
    assert tables == as_compact(read_results(RESULTS)), "write them again: table --into RESULTS.md"


def test_the_table_of_the_readme_is_of_the_results():
    results = text("RESULTS.md")
    rows = re.findall(
        r"^\| ([\w ]+?)(?: \(ours\))? +\| (400|4000) +\| (.+?) \| (\S+) \| (\S+) \| (\d) \|$", text("README.md"), re.M
    )
    assert len(rows) == 9
    for model, frames, start, paper, ours, seeds in rows:
        part = results.partition(f"### {frames} frames")[2].partition("\n\n### ")[0]
        cells = [[cell.strip(" *") for cell in line.split("|")[1:-1]] for line in part.splitlines()]
        (found,) = (row for row in cells if row[:4] == ["nonlinear", model, start, seeds])
        assert found[6].startswith(f"{ours} ({paper})"), found  # noise, 4 kHz


def test_the_model_of_the_worked_example_is_a_linear_string():
    (example,) = re.findall(r"```python\n(.*?)```", text("docs/models.md"), re.DOTALL)
    names: dict[str, Any] = {"__name__": "damped_modes"}
    exec(compile(example, "docs/models.md", "exec", dont_inherit=True), names)
    resonator = resonator_of(StringParameters(0.65, 5.188e-07, 1.41e-13, 1140.0, 5.4e9, 8e-05, 1.4e-05, 60.97), 25)
    model = names["DampedModes"](names["DampedModesConfiguration"]())
    model.initialise("physics", Physics(resonator, 16_000), torch.Generator().manual_seed(0))
    start = torch.zeros(1, 101)
    start[0, 1:-1] = torch.rand(99, generator=torch.Generator().manual_seed(0))
    whole, last = model.advance(model.encode(start), 300)
    first, state = model.advance(model.encode(start), 100)
    second, end = model.advance(state, 200)
    assert torch.allclose(whole, torch.cat([first, second], dim=1), atol=1e-6)
    ear = torch.rand(101, 2, generator=torch.Generator().manual_seed(1), dtype=torch.float64)
    assert torch.allclose(model.advance(model.encode(start), 300, ear)[0], whole @ ear.float(), atol=1e-5)
    assert torch.allclose(last, end)
    expected = torch.exp(300 * Physics(resonator, 16_000).log_eigenvalues)
    assert torch.allclose(last / model.encode(start), expected, atol=1e-9)


@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)
def test_notebooks_run(path, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    matplotlib.use("agg")
    names: dict[str, Any] = {"__name__": "__main__"}
    for cell in json.loads(path.read_text("utf-8"))["cells"]:
        if cell["cell_type"] == "code":
            assert not cell["outputs"] and cell["execution_count"] is None, "clear the outputs before committing"
            exec(compile("".join(cell["source"]), f"{path.name}:{cell['id']}", "exec", dont_inherit=True), names)
    assert list(tmp_path.glob("*.png"))


def test_the_run_and_the_smallest_instrument_of_the_documents_are_read(tmp_path):
    (run,) = re.findall(r"```toml\n(.*?)```", text("docs/reproduce.md"), re.DOTALL)
    path = tmp_path / "my_run.toml"
    path.write_text(run, encoding="utf-8")
    assert load(str(path)).model == "koopman_var"
    (example,) = re.findall(r"```json\n(.*?)```", text("docs/instruments.md"), re.DOTALL)
    assert Instrument.model_validate_json(example).strings.kind == "fretted"


@pytest.mark.parametrize(
    ("page", "title"), [("instruments", "### Other fields"), ("drums", "## Write a drum by hand")]
)
def test_the_fields_that_a_page_names_exist(page, title):
    section = text(f"docs/{page}.md").partition(title)[2].partition("\n#")[0]
    named = " ".join(line.split("|")[1] for line in section.splitlines() if line.startswith("| `"))
    names = re.findall(r"\w+(?=[`.\[])", named)
    schema = json.dumps(Instrument.model_json_schema())
    assert len(names) > 5 and [name for name in names if f'"{name}"' not in schema] == []
