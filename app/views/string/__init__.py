"""The picture of the string: its motion, the pluck, the listening points, and the gestures on them."""
