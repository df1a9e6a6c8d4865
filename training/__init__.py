"""Training: data sets from the reference solver, and models fitted to them, down to a preset file.

`configuration`  what a run is; `cell` has it from a name
`start`          how its model starts, and what that is given of the string
`run`            a whole run: fit, errors, preset, and its row in `results`
`evaluate`       the errors of a model
`data`           data sets, their cache, and batches of them
`fitting`        losses, the training loop, checkpoints
`sweeping`       many runs: the plan, its order, the workers
`tables`         the paper's tables with our results
`cli`            its commands, which the app adds to its own
`research`       what models are compared with, and starts that no preset needs to sound
"""
