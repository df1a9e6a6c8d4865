"""A patch that is played: events come in, voices go out."""
