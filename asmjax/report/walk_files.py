"""From a walkthrough's frames to its files: report.json, frames.csv, arrays and figures."""

import math
import time

from asmjax.experiment.walkthrough import FrameResult
from asmjax.report.figures import RunPictures
from asmjax.report.figures.board import drawing
from asmjax.report.figures.frames import (
    FramePicture,
    animation,
    draw_frames,
    frame_picture,
)
from asmjax.report.figures.walkthrough import draw_walkthrough
from asmjax.report.measured import arrays_writer, light_parts, missing_text
from asmjax.report.outputs import Outputs
from asmjax.report.walk_record import WalkRecord, WalkSetting
from asmjax.report.walk_table import frames_csv
from asmjax.writing import text_writer

SAVE_SECONDS = 20.0
"""How often the report of the finished frames is written while frames are measured: what is lost
at most if the process is killed."""

RUNNING = "not yet: still running, or killed"
"""How a walkthrough ended as long as it did not."""


class WalkFiles:
    """Takes up frames as they are measured, and leaves their files in a folder.

    Args:
        outputs: the folder; must exist.
        save_arrays: also write each frame's images as frame_0000.npz, ...
    """

    def __init__(self, setting: WalkSetting, outputs: Outputs, *, save_arrays: bool):
        self.record = WalkRecord(setting)
        self._outputs, self._save_arrays = outputs, save_arrays
        self._pictures: list[FramePicture] = []
        self._exposed: float | None = None
        self._saved = -math.inf

    def add(self, result: FrameResult) -> None:
        """Take up the next frame.

        Raises:
            WriteError: report.json cannot be written.
        """
        number = result.input.number
        pictures = _pictures(result)
        if self._exposed is None:
            self._exposed = pictures.exposed
        picture = frame_picture(number, pictures, self._exposed)
        # Numbers and picture together or not at all, whenever Ctrl-C comes.
        self.record.add(result)
        self._pictures.append(picture)
        if time.monotonic() - self._saved > SAVE_SECONDS:
            # Names of frames to come too: the report is there before its files.
            self._keep(self.record.report(RUNNING), self.record.setting.frames)
            self._saved = time.monotonic()
        if self._save_arrays:
            arrays = arrays_writer(result.input.eyes[0], result.truth, result.methods, {})
            self._outputs.add({_arrays_name(number): arrays})

    def finish(self, report: dict) -> None:
        """Write everything about the frames so far, the numbers first.

        Args:
            report: of `record`.

        Raises:
            WriteError: some of it, or of what frames left, cannot be written.
        """
        self._keep(report, len(self.record.frames))
        title = f"{report['scene']}, {report['view']}; moving: {report['motion']}"
        missing = missing_text(self.record.setting.not_simulated)
        self._outputs.add(
            {
                "frames.csv": text_writer(lambda: frames_csv(report["frames"])),
                "walkthrough.png": drawing(lambda: draw_walkthrough(report, missing)),
                "frames.png": drawing(lambda: draw_frames(self._pictures, title + missing)),
                "walkthrough.gif": animation(self._pictures),
            }
        )
        self._outputs.finish()

    def _keep(self, report: dict, frames: int) -> None:
        """Write the report, as of a walkthrough with so many frames."""
        arrays = map(_arrays_name, range(frames)) if self._save_arrays else ()
        self._outputs.keep(report, arrays)


def _arrays_name(number: int) -> str:
    return f"frame_{number:04d}.npz"


def _pictures(result: FrameResult) -> RunPictures:
    """The frame under the uniform map drawn anew and under the adaptive map."""
    eye = result.input.eyes[0]
    size = eye.size
    direct, ambient = light_parts(eye, result.input.fitted)
    shown = [result.methods[0], result.adaptive]
    return RunPictures(
        title="",
        direct=direct,
        ambient=ambient,
        valid=eye.valid.reshape(size),
        truth=result.truth.visibility.reshape(size),
        visibilities={method.name: method.visibility.reshape(size) for method in shown},
    )
