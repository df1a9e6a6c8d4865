"""An instrument that is played: events come in, voices go out."""
