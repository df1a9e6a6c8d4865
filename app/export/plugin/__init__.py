"""An instrument as a native plug-in: its image, the kernels' object code, a shell in C, and their linking.

image     an instrument as one block of bytes that the shell reads, and the header of offsets
objects   the compiled kernels for each system
build     files of a plug-in: written, linked, installed
shell/    the plug-in's interface to hosts, in C
"""
