"""The benchmarks' command line: every benchmark parses its options, and the documents name those that there are."""

import re
import shlex
from pathlib import Path
from typing import Any

import typer

from bench.cli import bench, main

ROOT = Path(__file__).parents[1]
DOCUMENTS = sorted([*ROOT.glob("*.md"), *ROOT.glob("docs/*.md")])


def test_every_benchmark_parses_its_options_and_the_documents_name_no_other(capsys):
    commands: dict[str, Any] = typer.main.get_command(bench).commands
    for name in commands:
        assert main([name, "--help"]) == 0
        assert f"run.py bench {name}" in capsys.readouterr().out
        assert main([name, "--no-such-option"]) == 2
    texts = {path.name: path.read_text("utf-8") for path in DOCUMENTS}
    lines = [line for text in texts.values() for line in re.findall(r"(?:run\.py |`)bench ([a-z][^`\n#]*)", text)]
    measured = texts["benchmarks.md"].partition("## Measured")[2]
    lines += re.findall(r"\| `([a-z]+)`[^|\n]*\|$", measured, re.M)
    assert len(lines) > 20
    for line in lines:
        name, *words = shlex.split(line)
        assert name in commands, line
        options = {option for each in commands[name].params for option in each.opts}
        assert {word for word in words if word.startswith("--")} <= options, line
    assert set(commands) <= {shlex.split(line)[0] for line in lines}, "each benchmark's use is in a document"
