"""The tests nearest to what has changed, for a minute and a half: `python3 run.py test --quick`.

Changed are files that differ from the branch `main`, or, on it, from the last commit; when none does, those of the
last commit. A changed test runs first, then the test that mirrors a changed module, then those that import it. Files
that the time did not reach are named. `python3 run.py test` runs everything.
"""

from __future__ import annotations

import os
import re
import subprocess
import sys
import time
from pathlib import Path

ROOT = Path(__file__).parents[1]
SECONDS = 85.0
PRODUCT = ("app", "engine", "training", "bench")


def _git(*words: str) -> list[str]:
    done = subprocess.run(["git", *words], cwd=ROOT, capture_output=True, text=True)
    return done.stdout.split("\n")[:-1] if done.returncode == 0 else []


def changed_files() -> list[Path]:
    """The Python files that differ from `main`, or from the last commit or the one before; they exist."""
    start = (_git("merge-base", "main", "HEAD") or ["HEAD"])[0]
    names = _git("diff", "--name-only", start) + _git("ls-files", "--others", "--exclude-standard")
    names = names or _git("diff", "--name-only", "HEAD~1")
    return [path for path in sorted({ROOT / name for name in names}) if path.suffix == ".py" and path.is_file()]


def nearest_tests(changed: list[Path], tests: dict[Path, str]) -> list[Path]:
    """Test files in the order of their nearness to changed files; `tests` holds the text of each test file."""
    paths = [path.relative_to(ROOT).with_suffix("") for path in changed]
    modules = [path for path in paths if path.parts[0] in PRODUCT]
    mirrors = [ROOT / "tests" / module.parent / f"test_{module.name}.py" for module in modules]
    patterns = [
        rf"\b{'.'.join(module.parts)}\b|from {'.'.join(module.parts[:-1])} import .*\b{module.name}\b"
        for module in modules
    ]
    importing = [path for path, text in tests.items() if any(re.search(pattern, text) for pattern in patterns)]
    folders = {ROOT / "tests" / module.parent for module in modules}
    beside = sorted(importing, key=lambda path: (path.parent not in folders, path))
    return [path for path in dict.fromkeys([*changed, *mirrors, *beside]) if path in tests]


def main(arguments: list[str]) -> int:
    """Run ruff on changed files, then the nearest tests until the time is over; the status is 1 if one failed."""
    started = time.monotonic()
    changed = changed_files()
    tests = {path: path.read_text("utf-8") for path in sorted(ROOT.glob("tests/**/test_*.py"))}
    chosen = nearest_tests(changed, tests)
    print(f"{len(changed)} changed files, {len(chosen)} test files near them", flush=True)
    failed = False
    for words in (["check"], ["format", "--check"]) if changed else ():
        failed |= subprocess.call([sys.executable, "-m", "ruff", *words, *changed], cwd=ROOT) != 0
    env = {"OMP_NUM_THREADS": "1", **os.environ}
    size = min(os.cpu_count() or 1, 4)
    while chosen and (left := SECONDS - (time.monotonic() - started)) > 5:
        part, chosen = chosen[:size], chosen[size:]
        pytest = [sys.executable, "-m", "pytest", "-q", "-n", str(len(part)), "--dist", "loadfile"]
        try:
            done = subprocess.run([*pytest, *arguments, *part], cwd=ROOT, env=env, timeout=left)
            failed |= done.returncode not in (0, 5)
        except subprocess.TimeoutExpired:
            chosen = [*part, *chosen]
            break
    if chosen:
        print("not run to the end: " + " ".join(str(path.relative_to(ROOT)) for path in chosen))
    print(f"{time.monotonic() - started:.0f} s, {'failed' if failed else 'passed'}")
    return int(failed)


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
