"""Many runs: which ones and in which order (`plan`), one after another (`sweep`), as tasks (`task`) of processes here
(`processes`) or of a Dask cluster (`cluster`)."""
