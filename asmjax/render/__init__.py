"""The only sub-package that imports Mitsuba and Dr.Jit; scenes in, plain arrays out.

Which triangle a ray hits does not move smoothly, so this boundary is not differentiable;
gradients start at the buffers.
"""
