"""The accuracy of learning recorded notes: a folder of recordings against baselines, and synthetic notes."""
