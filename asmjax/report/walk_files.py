"""From a walkthrough's frames to its files: report.json, frames.csv, arrays and figures."""

import time
from pathlib import Path

from asmjax.experiment.walkthrough import FrameResult
from asmjax.report.figures import RunPictures
from asmjax.report.figures.board import save
from asmjax.report.figures.frames import (
    FramePicture,
    draw_frames,
    frame_picture,
    write_animation,
)
from asmjax.report.figures.walkthrough import draw_walkthrough
from asmjax.report.measured import light_parts, missing_text, write_arrays
from asmjax.report.outputs import ANALYSIS, PLAN, SINGLE_RUN, WALKTHROUGH, remove
from asmjax.report.record import write_json
from asmjax.report.walk_record import COMPLETE, WalkRecord, WalkSetting
from asmjax.report.walk_table import write_frames_csv

SAVE_SECONDS = 20.0
"""How often the report of the finished frames is written while frames are measured: what is lost
at most if the process is killed."""

RUNNING = "not yet: still running, or killed"
"""How a walkthrough ended as long as it did not."""


class WalkFiles:
    """Takes up frames as they are measured, and leaves their files in a folder.

    Args:
        folder: must exist.
        save_arrays: also write each frame's images as frame_0000.npz, ...
    """

    def __init__(self, setting: WalkSetting, folder: Path, *, save_arrays: bool):
        self.record = WalkRecord(setting)
        self._folder, self._save_arrays = folder, save_arrays
        self._pictures: list[FramePicture] = []
        self._exposed: float | None = None
        self._saved = time.monotonic()

    def add(self, result: FrameResult) -> None:
        """Take up the next frame."""
        number = result.input.number
        if number == 0:
            remove(self._folder, (*SINGLE_RUN, *WALKTHROUGH, *ANALYSIS, *PLAN))
        if self._save_arrays:
            path = self._folder / f"frame_{number:04d}.npz"
            write_arrays(path, result.input.eyes[0], result.truth, result.methods, {})
        pictures = _pictures(result)
        if self._exposed is None:
            self._exposed = pictures.exposed
        picture = frame_picture(number, pictures, self._exposed)
        # Numbers and picture together or not at all, whenever Ctrl-C comes.
        self.record.add(result)
        self._pictures.append(picture)
        if time.monotonic() - self._saved > SAVE_SECONDS:
            write_json(self._folder / "report.json", self.record.report(RUNNING))
            self._saved = time.monotonic()

    def finish(self, ended: str = COMPLETE) -> dict:
        """Write everything about the frames so far, the numbers first; returns the report."""
        report = self.record.report(ended)
        write_json(self._folder / "report.json", report)
        write_frames_csv(self._folder / "frames.csv", report["frames"])
        title = f"{report['scene']}, {report['view']}; moving: {report['motion']}"
        missing = missing_text(self.record.setting.not_simulated)
        save(draw_walkthrough(report, missing), self._folder / "walkthrough.png")
        save(draw_frames(self._pictures, title + missing), self._folder / "frames.png")
        write_animation(self._pictures, self._folder / "walkthrough.gif")
        return report


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
