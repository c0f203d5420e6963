# %% [markdown]
# # Hard cases, seen
# Thirty-six numerical traps of shadow maps stand in `asmjax.hard_cases` as data: what breaks, how
# to build it at any severity, its truth, its bound, and how failure is announced.
# `docs/stability.md` has all of them measured; here are some to look at. No renderer is needed.

# %%
import os

import numpy as np

from asmjax.hard_cases import CASES, THEMES, measure
from asmjax.hard_cases.figure import draw_theme
from asmjax.hard_cases.measure import algorithm_for
from asmjax.report.figures.board import CAPTION, EDGE, GAP, HEAD, Board
from asmjax.report.figures.style import FALSE_DARK, FALSE_LIT, hex_rgb, styled
from asmjax.report.view_pictures import view_pictures

SMOKE = "ASMJAX_SMOKE" in os.environ
SIDE = 32 if SMOKE else 160
TEXELS = SIDE**2
FAMILIES = (
    ("uniform", "adaptive") if SMOKE else ("uniform", "light-space", "subdivided", "adaptive")
)

for theme, title in THEMES.items():
    print(f"{title}: {sum(case.theme == theme for case in CASES.values())} cases")

# %% [markdown]
# ## Pictures
# A case at one severity: truth, then maps of one texel for each pixel. Orange is lit but shadowed
# in truth, blue is shadowed but lit. The adaptive map's tables count too, which is much of so
# small a budget.


# %%
def seen(name, severity, families=FAMILIES):
    """Pictures (height, width, 3) by title of a scene case: truth first, then each map."""
    scene = CASES[name].build(severity).traced(SIDE)
    pictures = view_pictures(name, scene.eye, scene.frame, scene.expected)
    shown = {"truth": pictures.shaded(pictures.truth)}
    for family in families:
        algorithm = algorithm_for(family, scene.frame.faces, TEXELS)
        state = algorithm.build(scene.eye, scene.frame, scene.rays)
        visibility = np.asarray(algorithm.visibility(state, scene.eye.points))
        image = pictures.shaded(visibility.reshape(scene.eye.size))
        wrong = scene.wrong(visibility).reshape(scene.eye.size)
        image[wrong & (pictures.truth == 0)] = hex_rgb(FALSE_LIT)
        image[wrong & (pictures.truth == 1)] = hex_rgb(FALSE_DARK)
        share = wrong.sum() / max(scene.judged.sum(), 1)
        shown[f"{family}: {share:.2%}"] = image
    return shown


@styled
def gallery(cases):
    """A row of pictures for each (name, severity)."""
    rows = [(name, severity, seen(name, severity)) for name, severity in cases]
    columns, side = 1 + len(FAMILIES), 2 * 128
    width, height = columns * (side + GAP) - GAP, HEAD + side + 2 * GAP
    board = Board(2 * EDGE + width, 2 * EDGE + len(rows) * height + CAPTION)
    for i, (name, severity, shown) in enumerate(rows):
        y = EDGE + i * height
        for k, (title, image) in enumerate(shown.items()):
            x = EDGE + k * (side + GAP)
            if k == 0:
                board.heading(x, y, width, f"{name}; {CASES[name].axis}: {severity:g}", title)
            else:
                board.heading(x, y, side, "", title)
            board.image(x, y + HEAD, side, side, image, interpolation="nearest")
    board.caption(
        "Orange: lit, but shadowed in truth. Blue: the other way round. Shares: wrong pixels."
    )
    return board.figure


gallery(
    [
        ("light along the view", 75.0),
        ("light against the view: duelling frusta", 45.0),
        ("light parallel to the receiver", 85.0),
        ("casters smaller than texels", 30.0),
    ]
)

# %% [markdown]
# ## Severity
# Any severity may be asked for, not only those of the catalogue. A bias that grows with the texel
# keeps a tilted plane free of acne; its price is a cover so close above its receiver that the
# bias forgives it. That distance is known, so the failure is announced and not silent.


# %%
def table(name, severities):
    """What the uniform map does at each severity, and how it says so."""
    case = CASES[name]
    print(f"{name}: {case.breaks}")
    for record in measure(
        case, severities=severities, precisions=("float32",), algorithms=("uniform",)
    ):
        verdict = f"{record.verdict}{': ' if record.how else ''}{record.how}"
        print(f"  {case.axis} {record.severity:g}: {record.error:.2%} wrong, {verdict}")


table("acne on a tilted plane", (0.0, 60.0, 89.0, 89.9))
table("light through a cover close to its receiver", (2.0, 10.0, 100.0, 1e6))

# %%
gallery([("light through a cover close to its receiver", severity) for severity in (100.0, 1e6)])

# %% [markdown]
# ## Kernels
# The other cases ask one kernel, beside fifty digits or a closed form, in both precisions. An
# address of a texel in float32 has 24 bits; kept as an integer and a fraction it holds on.

# %%
kernels = [case for case in CASES.values() if case.theme == "addresses"][:3]
records = [
    record for case in kernels for record in measure(case, severities=case.few if SMOKE else None)
]
draw_theme(kernels, records)
