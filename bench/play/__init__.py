"""The app measured from outside: keys are sent to its window, and what the sound card receives is recorded."""
