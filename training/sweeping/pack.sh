#!/bin/sh
# Fill a folder with what `piece.sh` needs, from the last commit: sh training/sweeping/pack.sh FOLDER
set -e
to=$(mkdir -p "$1" && cd "$1" && pwd)
cd "$(dirname "$0")/../.."
git archive HEAD engine training | tar -x -C "$to"
git rev-parse --short=10 HEAD > "$to/COMMIT"
