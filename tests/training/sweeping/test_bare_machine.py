"""A sweep where there is no app: on a machine that has torch and what `piece.sh` installs."""

import subprocess
import sys
from pathlib import Path

from training.results import read_results

CODE = Path(__file__).parents[3]
MISSING = ("app", "presets", "tests", "PySide6", "scipy", "dask", "distributed", "sounddevice", "mido")
RUN = f"""
import sys
sys.modules.update(dict.fromkeys({MISSING!r}))  # to import one is an error
elsewhere = tuple({[str(CODE / name) for name in ("app", "presets", "tests", "docs")]!r})


def refuse(event, arguments):
    if event == "open" and str(arguments[0]).startswith(elsewhere):
        raise FileNotFoundError(arguments[0])


sys.addaudithook(refuse)
from pathlib import Path
from engine.schema import read, write
from training.results import Row, add_rows
from training.sweeping.plan import load_plan
from training.sweeping.sweep import Options
from training.sweeping.task import perform
import training.cli.__main__

plan = load_plan("tiny")
ended = perform(write(Options().task(plan, plan.runs[0])))
assert not ended["error"], ended["error"]
add_rows(Path("rows.csv"), [read(Row, row, "row") for row in ended["rows"]])
"""


def test_engine_and_training_alone_sweep(tmp_path):
    environment = {"PYTHONPATH": str(CODE), "LEARNED_STRINGS_COMMIT": "abc", "PATH": ""}
    subprocess.run([sys.executable, "-P", "-c", RUN], cwd=tmp_path, env=environment, check=True, timeout=300)
    rows = read_results(tmp_path / "rows.csv")
    assert {(row.status, row.device, row.commit) for row in rows} == {("done", "cpu", "abc")}
    assert all(row.hardware and row.torch for row in rows)
