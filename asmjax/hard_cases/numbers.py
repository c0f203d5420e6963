"""Severities and errors as a page and its figures write them."""

import math

_RAISED = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")


def power_of_ten(exponent: float) -> str:
    """10 with a raised whole exponent; 1 for 0."""
    k = round(exponent)
    return "1" if k == 0 else f"10{str(k).translate(_RAISED)}"


def severity_text(severity: float) -> str:
    """A severity: plain up to four digits, a power of ten beyond."""
    exponent = math.log10(abs(severity)) if severity else 0.0
    if abs(exponent) >= 3 and math.isclose(exponent, round(exponent), abs_tol=1e-9):
        return power_of_ten(exponent)
    return f"{severity:.8g}"


def error_text(error: float | None) -> str:
    """An error to one digit."""
    if error is None:
        return "-"
    if error == 0:
        return "0"
    if error >= 0.1:
        return f"{error:.2g}"
    return f"{error:.0e}".replace("e-0", "e-")


def share_text(share: float) -> str:
    """A share as a percentage to one place; "-" where there is none."""
    if math.isnan(share):
        return "-"
    return "0" if share == 0 else f"{100 * share:.1f} %"
