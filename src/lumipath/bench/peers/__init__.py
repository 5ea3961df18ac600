"""Other renderers, each in a process of its own, which may be another Python: their packages disagree about NumPy.

`serve`, `mitsuba_peer` and `cycles_peer` are scripts that import nothing of lumipath, so that any Python runs them.
"""
