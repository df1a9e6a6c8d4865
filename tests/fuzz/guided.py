"""Fuzzing that looks for new ways through the readers: what a file must be like to reach another line of them.

    python -m tests.fuzz.guided [TARGET ...] [--seconds 60]

Needs `atheris` (Linux; not among the program's own requirements). Each target of `readers` is a process of its
own. What is refused must be refused by that reader's own error, in one line; the first file for which this does not
hold is kept in the present folder, and its traceback is printed. Status 1 where there is any.
"""

import argparse
import importlib.util
import subprocess
import sys
import tempfile
from pathlib import Path

LONGEST_BYTES = 20_000  # of a file; a whole one of its kind is smaller, or it is cut


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("target", nargs="*", help="names of files; default: all")
    parser.add_argument("--seconds", type=int, default=60, help="for each")
    parser.add_argument("--alone", action="store_true", help=argparse.SUPPRESS)
    chosen = parser.parse_args()
    if importlib.util.find_spec("atheris") is None:
        print("guided fuzzing needs atheris: pip install atheris", file=sys.stderr)
        return 2
    if chosen.alone:
        _fuzz(chosen.target[0], chosen.seconds)
    from tests.fuzz.readers import TARGETS

    command = [sys.executable, "-m", "tests.fuzz.guided", "--alone", "--seconds", str(chosen.seconds)]
    failed = [name for name in chosen.target or [each.name for each in TARGETS] if subprocess.call([*command, name])]
    print(f"failed: {', '.join(failed)}" if failed else "nothing failed")
    return bool(failed)


def _fuzz(name: str, seconds: int) -> None:
    """Never returns: the library ends the process."""
    import atheris

    root = Path(__file__).parents[2]
    files = [file for file in root.glob("engine/**/*.py") if "numba" in file.read_text(encoding="utf-8")]
    compiled = [".".join(file.relative_to(root).with_suffix("").parts) for file in files]  # without probes
    with atheris.instrument_imports(include=["app", "engine", "training"], exclude=compiled):
        from tests.fuzz.readers import TARGETS, in_one_line

    (target,) = (each for each in TARGETS if each.name == name)
    with tempfile.TemporaryDirectory(prefix="guided") as folder:
        corpus, place = Path(folder) / "corpus", Path(folder) / "there"
        corpus.mkdir()
        place.mkdir()
        (corpus / "whole").write_bytes(target.whole(Path(folder)))
        path = place / name

        def one(data: bytes) -> None:
            path.write_bytes(data)
            try:
                target.read(path)
            except target.errors as error:
                in_one_line(error, path)

        length = max(LONGEST_BYTES, (corpus / "whole").stat().st_size)
        limits = [f"-max_total_time={seconds}", f"-max_len={length}", "-timeout=20", "-rss_limit_mb=3000"]
        atheris.Setup([sys.argv[0], *limits, "-print_final_stats=0", "-verbosity=0", str(corpus)], one)
        atheris.Fuzz()


if __name__ == "__main__":
    sys.exit(main())
