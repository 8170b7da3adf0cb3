"""From Blender's evaluated scene to the native session. `depsgraph.py` knows the order; every other module
one kind of data.

Everything is copied while a callback of Blender runs: no module keeps a reference to Blender's data.
"""
