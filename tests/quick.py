"""The tests nearest to what has changed, for a minute and a half: `python3 run.py test --quick`.

Changed are files that differ from the branch `main`, or, on it, from the last commit; when none does, those of the
last commit. A changed test runs first, then the test that mirrors a changed module, then those that import it. Files
that the time did not reach are named. `python3 run.py test` runs everything.
"""

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


def _text_of(test: Path) -> str:
    """The text of a test and of the table beside it, as `calls.txt` of `test_calls.py`."""
    table = test.with_name(f"{test.stem.removeprefix('test_')}.txt")
    return test.read_text("utf-8") + (table.read_text("utf-8") if table.is_file() else "")


def nearest_tests(changed: list[Path]) -> list[Path]:
    """Test files in the order of their nearness to changed files."""
    tests = {path: _text_of(path) for path in sorted(ROOT.glob("tests/**/test_*.py"))}
    modules = [path.relative_to(ROOT).with_suffix("") for path in changed]
    modules = [module for module in modules if module.parts[0] in PRODUCT]
    mirrors = [ROOT / "tests" / module.parent / f"test_{module.name}.py" for module in modules]
    pattern = "|".join(
        rf"\b{'.'.join(module.parts)}\b|from {'.'.join(module.parts[:-1])} import .*\b{module.name}\b"
        for module in modules
    )
    importing = [path for path, text in tests.items() if modules and re.search(pattern, text)]
    folders = {path.parent for path in mirrors}
    beside = sorted(importing, key=lambda path: (path.parent not in folders, path))
    return [path for path in dict.fromkeys([*changed, *mirrors, *beside]) if path in tests]


def main(arguments: list[str]) -> int:
    """Run ruff on changed files, then the nearest tests until the time is over; the status is 1 if one failed."""
    ends = time.monotonic() + SECONDS
    changed = changed_files()
    chosen = nearest_tests(changed)
    print(f"{len(changed)} changed files, {len(chosen)} test files near them", flush=True)
    ruff = [[sys.executable, "-m", "ruff", *words, *changed] for words in (["check"], ["format", "--check"])]
    failed = sum(subprocess.call(command, cwd=ROOT) for command in ruff if changed) > 0
    size = min(os.cpu_count() or 1, 4)
    pytest = [sys.executable, "-m", "pytest", "-q", "-n", str(size), "--dist", "loadfile", *arguments]
    while chosen and (left := ends - time.monotonic()) > 5:
        try:
            command = [*pytest, *chosen[:size]]
            done = subprocess.run(command, cwd=ROOT, env={"OMP_NUM_THREADS": "1", **os.environ}, timeout=left)
        except subprocess.TimeoutExpired:
            break
        failed |= done.returncode not in (0, 5)
        del chosen[:size]
    if chosen:
        print("not run to the end: " + " ".join(str(path.relative_to(ROOT)) for path in chosen))
    print(f"{SECONDS - (ends - time.monotonic()):.0f} s, {'failed' if failed else 'passed'}")
    return int(failed)


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
