"""Generated pages of the site: command line, presets, API, tables of fields, notebooks, repository documents.

A hook of MkDocs; `python3 run.py docs` builds the site.
"""

from __future__ import annotations

import contextlib
import importlib
import io
import json
import math
import re
import shutil
import tempfile
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import soundfile
import typer
from matplotlib.figure import Figure
from mkdocs.config.defaults import MkDocsConfig
from mkdocs.structure.files import File, Files
from mkdocs.structure.pages import Page

ROOT = Path(__file__).resolve().parents[1]
DOCUMENTS = {  # of the repository's root, and their pages
    "README.md": "index.md",
    "RESULTS.md": "results.md",
    "ARCHITECTURE.md": "architecture.md",
    "CONTRIBUTING.md": "contributing.md",
    "SECURITY.md": "security.md",
    "CHANGELOG.md": "changelog.md",
    "LICENSE": "license.md",
}
# what the cards of presets play and draw
PLUCK = ("--position", "0.3", "--amplitude-mm", "2", "--seconds", "1.5", "--normalise")
BOTH = ("--rate", "48000", "--source", "both")
NOTEBOOKS = ("quickstart", "comparing_with_the_truth")


def on_files(files: Files, config: MkDocsConfig) -> Files:
    pages = {page: (ROOT / name).read_text("utf-8").replace("](docs/", "](") for name, page in DOCUMENTS.items()}
    pages |= {f"notebooks/{name}.md": notebook(ROOT / "docs" / "notebooks" / f"{name}.ipynb") for name in NOTEBOOKS}
    pages |= {"command-line.md": command_line(), "presets.md": presets(), "api.md": api()}
    contents: list[tuple[str, str | bytes]] = [*pages.items(), *sounds_and_spectra()]
    for path, content in contents:
        files.append(File.generated(config, path, content=content))
    return files


def on_page_markdown(markdown: str, page: Page, config: MkDocsConfig, files: Files) -> str:
    up = "../" * page.file.src_uri.count("/")
    for name, target in DOCUMENTS.items():
        markdown = re.sub(rf"\]\((\.\./)*{re.escape(name)}([)#])", rf"]({up}{target}\2", markdown)
    return markdown.replace("<!-- generated: fields -->", fields()).replace(
        "<!-- generated: benchmarks -->", benchmarks()
    )


def command_line() -> str:
    """The help of every command, as the program prints it."""
    from app.commands.cli import cli

    parts = ["# Command line\n\n`python3 run.py -- COMMAND`, or `learned-strings COMMAND` in the environment."]
    for words, text in help_texts(typer.main.get_command(cli), "learned-strings"):
        parts.append(f"{'#' * (len(words) + 1)} {' '.join(words)}\n\n```text\n{text}\n```")
    return "\n\n".join(parts)


def help_texts(command: Any, name: str, words: tuple[str, ...] = ()) -> list[tuple[tuple[str, ...], str]]:
    """Names and help of all commands below `command`, groups before their commands."""
    context = command.context_class(
        command, info_name=" ".join((name, *words)), max_content_width=100, terminal_width=100
    )
    found = [(words, command.get_help(context).strip())] if words else []
    for part, below in getattr(command, "commands", {}).items():
        found += help_texts(below, name, (*words, part))
    return found


def benchmarks() -> str:
    from bench.cli import bench

    commands = typer.main.get_command(bench).commands  # type: ignore[attr-defined]
    rows = [
        f"| `{name}` | {' '.join((each.help or '').split(chr(10) + chr(10))[0].split())} |"
        for name, each in commands.items()
    ]
    return "\n".join(["| name | measures |", "|---|---|", *rows])


def presets() -> str:
    """A card for each preset: what `presets --json` reports of it, a pluck and its spectrum."""
    parts = [
        "# Presets\n\nErrors are relative, over the training horizon. *Heard* is past it: see [results](results.md). "
        "The sound is the model's, of a pluck of 2 mm at 0.3. In the spectrum amber is the model, blue the truth."
    ]
    return "\n\n".join([*parts, *(card(each) for each in shipped())])


def shipped() -> list[dict[str, Any]]:
    """Return what `presets --json` reports of the presets of this repository."""
    from app.commands.cli import main

    printed = io.StringIO()
    with contextlib.redirect_stdout(printed):
        assert main(["presets", "--json"]) == 0
    return [each for each in json.loads(printed.getvalue()) if Path(each["file"]).parent == ROOT / "presets"]


def sounds_and_spectra() -> Iterator[tuple[str, bytes]]:
    """Names and contents of a FLAC and a PNG for the card of each preset."""
    from app.commands.cli import main

    with tempfile.TemporaryDirectory() as folder:
        for each in shipped():
            name, wav, flac = each["name"], Path(folder, "pluck.wav"), io.BytesIO()
            with contextlib.redirect_stdout(io.StringIO()), contextlib.redirect_stderr(io.StringIO()):
                assert main(["render", name, str(wav), *PLUCK, *BOTH]) == 0, name
            both, rate_hz = soundfile.read(wav)
            soundfile.write(flac, both[:, 0], rate_hz, format="FLAC")
            yield f"presets/{name}.flac", flac.getvalue()
            yield f"presets/{name}.png", spectrum(both, rate_hz)


def spectrum(both: np.ndarray, rate_hz: int) -> bytes:
    """A picture of the spectra of model and truth, (frames, 2), in dB below the truth's maximum."""
    levels = np.abs(np.fft.rfft(both * np.hanning(len(both))[:, None], axis=0))
    levels_db = 20 * np.log10(np.maximum(levels / levels[:, 1].max(), 1e-6))
    figure, picture = Figure(figsize=(7, 2), layout="constrained"), io.BytesIO()
    axes = figure.subplots()
    for column, colour in ((1, "#3a8fb7"), (0, "#e69f00")):
        axes.plot(np.fft.rfftfreq(len(both), 1 / rate_hz), levels_db[:, column], color=colour, linewidth=0.7)
    axes.set(xscale="log", xlim=(50, 20_000), ylim=(-100, 5), xlabel="frequency (Hz)", ylabel="dB")
    figure.savefig(picture, format="png", dpi=80)
    return picture.getvalue()


def card(preset: dict[str, Any]) -> str:
    from engine.presets import find_preset, load_preset

    info = load_preset(find_preset(preset["name"])).info
    string = info.string
    errors = [preset[name] for name in ("rel_mse", "test_rel_mse", "rel_mae", "test_rel_mae")]
    validation, test, mae, test_mae = ("—" if value is None else f"{value:.2g}" for value in errors)
    pitch_hz = float(info.resonator.eigenvalues()[0].imag) / math.tau
    return "\n".join(
        [
            f"## {info.title}\n",
            f"`{preset['name']}`\n",
            "| | |",
            "|---|---|",
            f"| model | {preset['model']}, {preset['parameters']} parameters |",
            f"| string | {preset['string']}, {pitch_hz:.1f} Hz, {string.length_m:g} m, {string.tension_n:g} N |",
            f"| rate, horizon | {info.rate_hz} Hz, {info.horizon_s:g} s |",
            f"| MSE, validation; test | {validation}; {test} |",
            f"| MAE, validation; test | {mae}; {test_mae} |",
            f"| heard | {preset['heard'] or '—'} |",
            f"\n![Spectra of model and truth](presets/{preset['name']}.png)\n",
            f'<audio controls preload="none" src="presets/{preset["name"]}.flac"></audio>',
        ]
    )


def api() -> str:
    """The public names of `engine`, from their docstrings."""
    import engine

    parts = ["# API\n\n`engine` is the public library; [the quickstart](notebooks/quickstart.md) uses it."]
    for name in engine.__all__:
        value = getattr(importlib.import_module("engine"), name)
        parts.append(f"::: {value.__module__}.{value.__qualname__}")
    parts += ["::: engine.models.base.StringModel"]
    return "\n\n".join(parts)


def fields() -> str:
    """The table of parameters of an instrument."""
    from engine.parameters import OF_INSTRUMENTS

    rows = [
        f"| `{each.id}` | {each.limits[0]:g} … {each.limits[1]:g} | {each.default:g} | {each.tip} |"
        for each in OF_INSTRUMENTS.values()
    ]
    return "\n".join(["| field | range | default | meaning |", "|---|---|---|---|", *rows])


def notebook(path: Path) -> str:
    """The cells of a notebook as Markdown; code is in fences."""
    cells = json.loads(path.read_text("utf-8"))["cells"]
    texts = [(cell["cell_type"], "".join(cell["source"])) for cell in cells]
    return "\n\n".join(text if kind == "markdown" else f"```python\n{text}\n```" for kind, text in texts)


def on_post_build(config: MkDocsConfig) -> None:
    """Copies what only README links to."""
    shutil.copy(ROOT / "LICENSE", Path(config.site_dir) / "LICENSE")
