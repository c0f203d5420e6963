"""How many settings a search tries; what `asmjax tune` allows and its help says follow from it."""

SAMPLES = 36
"""Of the evaluations, those drawn at random that the surrogate is fitted to first."""

SINGLES = 14
"""Of the evaluations, at most those that differ from the default in one setting: people try these
first, and around the default the fit must be right."""

ROUNDS, PROPOSALS = 2, 5
"""Rounds of searching, and settings that each proposes and that are measured."""

LEAST_EVALUATIONS = SINGLES + SAMPLES + ROUNDS * PROPOSALS
"""Fewer leave nothing for neighbours."""

GRID_POINTS = 32
"""Settings of the grid that a search is set beside."""
