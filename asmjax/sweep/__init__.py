"""Sweeps: many trials of algorithms, settings, scenes and views, each measured once.

A file says which trials there are (`config`, its `axes`, the `fields` of a trial). `resolve` fills
in what it leaves out, `identity` gives every trial a key, `estimate` says how long all will take.
The `driver` has them run where there is a `pool`, and keeps them in a `store`, of which `results`
makes tables; `trial` runs one, in a process that keeps scenes and views `ready` for the next one.
"""
