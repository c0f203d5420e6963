"""A colour and a marker for each family of shadow algorithms, the same in all figures."""

FAMILY_LOOKS: dict[str, tuple[str, str]] = {
    "uniform": ("#4D4D4D", "s"),
    "adaptive": ("#009E73", "o"),
    "perspective": ("#D55E00", "v"),
    "light-space": ("#0072B2", "^"),
    "trapezoidal": ("#CC79A7", "P"),
    "logarithmic": ("#E69F00", "D"),
    "partitioned": ("#56B4E9", "X"),
    "subdivided": ("#7A3E9D", "*"),
    "tuned": ("#8B5A2B", "p"),
    "filtered": ("#B22222", "d"),
    "pcss": ("#44AA99", "<"),
    "moment": ("#882255", ">"),
    "accumulated": ("#999933", "8"),
}
"""Family to colour (Okabe and Ito's, then a violet, a brown and a red) and marker."""

_OTHER = ("#000000", "h")


def look_of(family: str) -> tuple[str, str]:
    """Colour and marker of a family; one look for all that are not known here."""
    return FAMILY_LOOKS.get(family, _OTHER)
