"""The stage: all that is chosen, played and shown, as one immutable value; undo."""
