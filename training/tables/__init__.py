"""The paper's tables with our results beside them.

`paper`     what stands where, the paper's figures, and how one of ours compares
`sections`  our figures, from the rows of the results file
`markdown`  both, to be read
`tidy_csv`  both, to be computed with
"""
