"""Widgets. They show the values that they are given and emit signals for gestures; `app.window` connects them.

Like all of Qt's widgets they belong to the window's thread: no other thread may call them.
"""
