"""`python -m bench`: what `run.py bench` starts."""

import sys

from bench.cli import main

sys.exit(main())
