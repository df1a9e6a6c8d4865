"""The paper's tables with our results.

`paper`     what stands where, the paper's figures, and how one of ours compares
`sections`  our figures, from the rows of the results file
`compact`   both in one table per horizon, for RESULTS.md
`tidy_csv`  both, to be computed with
"""
