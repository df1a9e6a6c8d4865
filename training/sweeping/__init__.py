"""Many runs: which ones and in which order (`plan`), one after another (`sweep`), in other processes (`workers`)."""
