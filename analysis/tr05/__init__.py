"""The steps of `subdivided_shadow_maps_tr05.py`, by section of the paper, and its document."""
