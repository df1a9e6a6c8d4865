"""`python -m tests.bench`: what `run.py bench` starts."""

import sys

from tests.bench.cli import main

sys.exit(main())
