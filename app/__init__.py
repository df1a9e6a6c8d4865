"""The app: a window to pluck, see, hear, compare and export; and the command line."""
