"""An instrument for samplers: every key at several velocities, for players of SFZ and of SoundFont 2."""
