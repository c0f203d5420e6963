"""The document of `adaptive_shadow_maps_2001.py`."""
