"""The compiled player: from events to voices."""
