#!/bin/sh
# Minutes of a plan on a machine that has Python and torch alone: sh training/sweeping/piece.sh [OPTIONS OF SWEEP]
# in a folder made by `pack.sh`. Run again it continues. Rows go to training/results.csv, checkpoints to runs/.
set -e
cd "$(dirname "$0")/../.."
python=${PYTHON:-python3}
packages="numba numpy pydantic safetensors typer"
"$python" -c "import $(echo $packages | tr ' ' ',')" 2>/dev/null || "$python" -m pip install $packages
export LEARNED_STRINGS_COMMIT=$(cat COMMIT)
[ $# -gt 0 ] || set -- published --device cuda --minutes 9
exec "$python" -m training.cli "$@"
