"""The command line of training, which `app.commands.cli` adds to its own; and what all commands print and share."""
