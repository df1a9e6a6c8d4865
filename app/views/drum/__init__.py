"""The picture of a drum: its motion in two dimensions, its strike, and the directions it is heard from."""
