"""An instrument as a sampled instrument: every key at several velocities, for players of SFZ and of SoundFont 2."""
