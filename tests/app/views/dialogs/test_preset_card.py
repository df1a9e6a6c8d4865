"""What a preset's card and its line say of the errors, of both splits."""

from __future__ import annotations
