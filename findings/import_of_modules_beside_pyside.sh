#!/usr/bin/env bash
# Memory of an import in Python once PySide6 is loaded.
#
# Guess, written before the run: an import takes the same memory with PySide6 as without.
#
# Seen (Linux, x86-64, Python 3.11, PySide6 6.11.3): PySide6 replaces `builtins.__import__`, for its switch `from __feature__
# import snake_case`. The replacement looks for the word "PySide6" in the source of every module that is imported,
# with inspect.getsource, and the module linecache keeps all these lines for good. With SciPy's statistics as the example
# they take megabytes. linecache.clearcache() gives little back to the system, since the lines lie between other objects.
# `builtins.__import__ = builtins.__orig_import__` after the first import of PySide6 ends it; the switch is then lost.
#
# Needs python3 (3.11 or later) with venv, and a package index. Fails if sources are no longer kept.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/pip" install --quiet PySide6-Essentials==6.11.3 shiboken6==6.11.3 numpy==2.4.6 scipy==1.17.1
for plain in "" plain; do
    "$folder/venv/bin/python" - $plain <<'PY'
import builtins
import linecache
import sys

import PySide6.QtCore

plain = len(sys.argv) > 1
if plain:
    builtins.__import__ = builtins.__orig_import__
import scipy.stats

kept = sum(sum(map(sys.getsizeof, entry[2])) for entry in linecache.cache.values() if len(entry) > 1)
print(f"PySide6 {PySide6.__version__}, {'plain' if plain else 'its own'} import: {kept / 1e6:.1f} MB of source lines kept")
assert (kept < 1e6) if plain else (kept > 5e6), "sources are kept otherwise"
PY
done
