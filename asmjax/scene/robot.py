"""The robot of the paper room: jointed limbs, a waving hand with fingers, a spring antenna.

Features from half a metre (torso) to six millimetres (antenna wire): the 2001 paper, section 5,
uses its robot for "intricate shadow details of varying scale".
"""

import math

import numpy as np

from asmjax.scene.mesh_tools import merge, rotation, transform
from asmjax.scene.shapes import bevelled_box, box, cylinder, rounded_solid, sphere, tube
from asmjax.scene.spec import Mesh, Vector

_STEEL: Vector = (0.42, 0.55, 0.68)
_DARK: Vector = (0.20, 0.21, 0.24)
_ACCENT: Vector = (0.86, 0.42, 0.13)


def make_robot() -> tuple[Mesh, Mesh, Mesh]:
    """Shell, joints and accents, about 1.75 units tall, looking along +x, soles at z = 0."""
    shell, joints, accents = [], [], []
    _torso_and_head(shell, joints, accents)
    for side in (-1.0, 1.0):
        _leg(side, shell, joints)
    _arm(
        shell,
        joints,
        shoulder=(0.0, 0.285, 1.06),
        elbow=(0.07, 0.52, 1.10),
        wrist=(0.17, 0.60, 1.38),
    )
    _arm(
        shell,
        joints,
        shoulder=(0.0, -0.285, 1.06),
        elbow=(0.02, -0.40, 0.80),
        wrist=(0.24, -0.37, 0.66),
    )
    return (
        merge("robot_shell", shell, _STEEL),
        merge("robot_joints", joints, _DARK),
        merge("robot_accents", accents, _ACCENT),
    )


def _torso_and_head(shell: list[Mesh], joints: list[Mesh], accents: list[Mesh]) -> None:
    shell += [
        bevelled_box("pelvis", (-0.11, -0.17, 0.55), (0.11, 0.17, 0.70), 0.035),
        bevelled_box("chest", (-0.15, -0.22, 0.77), (0.15, 0.22, 1.15), 0.045),
        bevelled_box("head", (-0.12, -0.16, 1.21), (0.16, 0.16, 1.45), 0.035),
    ]
    joints += [cylinder("waist", (0, 0, 0.68), (0, 0, 0.80), 0.075, 14)]
    joints += [cylinder("neck", (0.0, 0.0, 1.13), (0.01, 0.0, 1.23), 0.05, 12)]
    for k in range(3):
        y = 0.045 * (k - 1)
        joints.append(box("grille", (0.14, y - 0.012, 1.252), (0.168, y + 0.012, 1.272)))
    accents.append(rounded_solid("plate", (0.15, 0.0, 1.00), (0.02, 0.12, 0.07), 4.0, 3))
    for side in (-1.0, 1.0):
        accents.append(sphere("eye", (0.155, 0.065 * side, 1.36), 0.034, 4))
        joints.append(
            cylinder("ear", (0.02, 0.155 * side, 1.33), (0.02, 0.195 * side, 1.33), 0.045, 12)
        )
    turn = np.linspace(0.0, 10.0 * math.pi, 62)
    wire = np.stack([0.018 * np.cos(turn), 0.018 * np.sin(turn), 1.44 + 0.18 * turn / turn[-1]])
    joints.append(tube("spring", wire, 0.004, 5))
    joints.append(cylinder("rod", (0.018, 0.0, 1.60), (-0.02, 0.0, 1.74), (0.008, 0.004), 5))
    accents.append(sphere("tip", (-0.02, 0.0, 1.74), 0.026, 3))


def _leg(side: float, shell: list[Mesh], joints: list[Mesh]) -> None:
    y = 0.11 * side
    stride = 0.07 * side
    knee = (0.03 + stride, y + 0.02 * side, 0.35)
    ankle = (-0.01 + stride, y + 0.03 * side, 0.10)
    shell += [
        cylinder("thigh", (0.0, y, 0.58), knee, (0.075, 0.055), 12),
        cylinder("shin", knee, ankle, (0.06, 0.045), 12),
        bevelled_box(
            "foot",
            (stride - 0.10, y + 0.03 * side - 0.07, 0.0),
            (stride + 0.19, y + 0.03 * side + 0.07, 0.10),
            0.03,
        ),
    ]
    joints += [
        sphere("hip", (0.0, y, 0.58), 0.075, 3),
        sphere("knee", knee, 0.066, 3),
        sphere("ankle", ankle, 0.055, 3),
    ]


def _arm(
    shell: list[Mesh], joints: list[Mesh], shoulder: Vector, elbow: Vector, wrist: Vector
) -> None:
    shell += [
        cylinder("upper arm", shoulder, elbow, (0.055, 0.045), 12),
        cylinder("forearm", elbow, wrist, (0.05, 0.036), 12),
    ]
    joints += [sphere("shoulder", shoulder, 0.085, 3), sphere("elbow", elbow, 0.058, 3)]
    along = np.asarray(wrist) - np.asarray(elbow)
    along = along / np.linalg.norm(along)
    frame = _frame_with_z(along)
    for part in _hand():
        joints.append(transform(part, frame, wrist))


def _hand() -> list[Mesh]:
    """Palm, three fingers and a thumb, wrist at the origin, fingers along +z, spread in y."""
    parts = [rounded_solid("palm", (0.0, 0.0, 0.055), (0.022, 0.052, 0.055), 4.0, 3)]
    for offset, lean, length in ((-0.036, -0.30, 0.070), (0.0, 0.0, 0.080), (0.036, 0.30, 0.070)):
        knuckle = np.array([0.0, offset, 0.10])
        middle = knuckle + length * np.array([0.10, math.sin(lean), math.cos(lean)])
        tip = middle + 0.8 * length * np.array([0.35, 0.9 * math.sin(lean), 0.95 * math.cos(lean)])
        path = np.stack([knuckle, middle, tip], axis=1)
        parts.append(tube("finger", path, np.array([0.014, 0.012, 0.008]), 7))
    thumb = np.array([[0.0, 0.02, 0.04], [-0.045, -0.085, -0.115], [0.04, 0.075, 0.115]])
    parts.append(tube("thumb", thumb, np.array([0.015, 0.013, 0.009]), 7))
    return parts


def _frame_with_z(axis: np.ndarray) -> np.ndarray:
    """Rotation that takes +z to `axis` the short way."""
    cross = np.cross((0.0, 0.0, 1.0), axis)
    length = float(np.linalg.norm(cross))
    if length < 1e-12:
        return np.diag([1.0, axis[2], axis[2]])
    x, y, z = (cross / length).tolist()
    return rotation((x, y, z), math.atan2(length, float(axis[2])))
