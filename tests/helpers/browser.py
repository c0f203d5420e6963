"""A headless Chromium, told what to do over a pipe: no driver and no package is needed for it."""

import base64
import json
import os
import shutil
import subprocess
import threading
from pathlib import Path
from queue import Empty, Queue
from typing import Any

NAMES = ("chromium", "chromium-browser", "google-chrome", "google-chrome-stable")
"""Programs that understand the protocol."""

FLAGS = (
    "--headless=new", "--no-sandbox", "--disable-gpu", "--no-first-run", "--disable-extensions",
    "--disable-background-networking", "--disable-component-update", "--disable-dev-shm-usage",
    "--disable-sync", "--remote-debugging-pipe", "--mute-audio",
)  # fmt: skip

SECONDS = 60
"""Longest wait for an answer."""


def browser_path() -> str | None:
    """A Chromium of this machine, or None."""
    return next((path for name in NAMES if (path := shutil.which(name))), None)


class Browser:
    """One page of a headless Chromium; a context that ends the program.

    Attributes:
        complaints: errors and warnings of its console, and exceptions of its scripts.
        requests: addresses that pages asked for, but those of data.
    """

    def __init__(self, program: str, folder: Path, width: int = 1280, height: int = 800):
        self.complaints: list[str] = []
        self.requests: list[str] = []
        self._events: Queue[dict] = Queue()
        self._count = 0
        # The program reads commands from descriptor 3 and writes answers to 4.
        theirs, ours = os.pipe()
        answers, writes = os.pipe()
        words = [program, *FLAGS, f"--user-data-dir={folder}", f"--window-size={width},{height}"]
        shell = 'exec "$@" 3<&"$IN" 4>&"$OUT"'
        self._program = subprocess.Popen(
            ["bash", "-c", shell, "browser", *words, "about:blank"],
            env=os.environ | {"IN": str(theirs), "OUT": str(writes)},
            pass_fds=(theirs, writes),
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
        )
        os.close(theirs)
        os.close(writes)
        self._out, self._answers = os.fdopen(ours, "wb", 0), os.fdopen(answers, "rb")
        threading.Thread(target=self._listen, daemon=True).start()
        self._session: str | None = None
        targets = self("Target.getTargets")["targetInfos"]
        page = next(target["targetId"] for target in targets if target["type"] == "page")
        attached = self("Target.attachToTarget", targetId=page, flatten=True)
        self._session = attached["sessionId"]
        for domain in ("Page", "Runtime", "Log", "Network"):
            self(f"{domain}.enable")
        self("Emulation.setDeviceMetricsOverride", width=width, height=height,
             deviceScaleFactor=1, mobile=False)  # fmt: skip

    def __enter__(self) -> "Browser":
        return self

    def __exit__(self, *_: object) -> None:
        self._program.terminate()
        self._program.wait(SECONDS)
        self._out.close()

    def __call__(self, method: str, **params: Any) -> dict:
        """Send a command of the protocol, and wait for its answer."""
        self._count += 1
        message: dict[str, Any] = {"id": self._count, "method": method, "params": params}
        if self._session:
            message["sessionId"] = self._session
        self._out.write(json.dumps(message).encode() + b"\0")
        while True:
            answer = self._next(method)
            if answer.get("id") == self._count:
                if "error" in answer:
                    raise RuntimeError(f"{method}: {answer['error']['message']}")
                return answer["result"]

    def open(self, address: str) -> None:
        """Go to an address, and wait until the page is loaded."""
        self("Page.navigate", url=address)
        while self._next("load").get("method") != "Page.loadEventFired":
            pass

    def evaluate(self, script: str) -> Any:
        """The value of an expression in the page. Raises `RuntimeError` where it throws."""
        answer = self("Runtime.evaluate", expression=script, returnByValue=True)
        if "exceptionDetails" in answer:
            raise RuntimeError(str(answer["exceptionDetails"]))
        return answer["result"].get("value")

    def point_at(self, x: float, y: float) -> None:
        """Move the pointer to a place in the window."""
        self("Input.dispatchMouseEvent", type="mouseMoved", x=x, y=y)

    def press(self, key: str) -> None:
        """Press and release a key by its name, such as ArrowRight."""
        codes = {"ArrowLeft": 37, "ArrowRight": 39}
        for kind in ("keyDown", "keyUp"):
            self("Input.dispatchKeyEvent", type=kind, key=key, code=key,
                 windowsVirtualKeyCode=codes[key])  # fmt: skip

    def print_to(self, path: Path) -> None:
        """Write what a printer would get as PDF."""
        printed = self("Page.printToPDF", printBackground=True, preferCSSPageSize=True)
        path.write_bytes(base64.b64decode(printed["data"]))

    def _listen(self) -> None:
        waiting = b""
        while chunk := self._answers.read1(1 << 16):
            *whole, waiting = (waiting + chunk).split(b"\0")
            for text in whole:
                self._events.put(json.loads(text))
        self._answers.close()

    def _next(self, what: str) -> dict:
        try:
            event = self._events.get(timeout=SECONDS)
        except Empty:
            raise TimeoutError(f"no answer of the browser to {what}") from None
        self._note(event.get("method", ""), event.get("params", {}))
        return event

    def _note(self, method: str, params: dict) -> None:
        if method == "Network.requestWillBeSent":
            address = params["request"]["url"]
            if not address.startswith("data:"):
                self.requests.append(address)
        elif method == "Runtime.exceptionThrown":
            self.complaints.append(params["exceptionDetails"]["text"])
        elif method == "Runtime.consoleAPICalled" and params["type"] in ("error", "warning"):
            self.complaints.append(str(params["args"]))
        elif method == "Log.entryAdded" and params["entry"]["level"] in ("error", "warning"):
            self.complaints.append(params["entry"]["text"])
