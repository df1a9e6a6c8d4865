"""The picture of a drum: its motion in two dimensions, where it is struck, and the directions it is heard from."""
