"""The sub-commands of the command line, one module per topic.

Every heavy import (torch, SciPy, sound files) stands inside the command that needs it. So `--help` is quick, and
libraries that a command does not need may be missing.
"""
