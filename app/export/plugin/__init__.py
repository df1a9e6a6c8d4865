"""An instrument as a native plug-in: its image, the kernels' object code, a shell in C, and their linking.

formats   kinds of plug-ins, systems, and where hosts look for them
identity  an instrument's identifier, and those in a built plug-in
layout    records of that block and of the kernels' memory, and the C header that has them
image     an instrument as one block of bytes that the shell reads
parts     what macros change: body, room, levels of keys
objects   the compiled kernels for each system
build     files of a plug-in: written, linked, installed
job       all of that for the window
shell/    the plug-in's interface to hosts, in C
"""
