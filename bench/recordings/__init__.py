"""How well recorded notes are learned: a folder of recordings against baselines, and synthetic notes."""
