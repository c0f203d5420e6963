"""A small network on one machine: a hub and spokes, each a namespace, which can be cut off.

Needs root and Linux: `ip`, `unshare` and `nsenter`. Nothing of it is left when the context ends.
"""

import shutil
import subprocess
from pathlib import Path

HUB = "10.77.0.1"
"""Address of the hub."""

PROGRAMS = ("ip", "nsenter", "unshare", "sleep")


class NoNetwork(Exception):
    """Namespaces cannot be made here; says why."""


class Network:
    """A hub (place 0) and so many spokes (places 1 and up), which only know the hub."""

    def __init__(self, spokes: int):
        self._spokes = spokes
        self._holders: list[subprocess.Popen] = []

    def __enter__(self) -> "Network":
        missing = [name for name in PROGRAMS if shutil.which(name) is None]
        if missing:
            raise NoNetwork(f"no {', '.join(missing)} here")
        try:
            for place in range(self._spokes + 1):
                self._hold()
                self._do(place, "ip", "link", "set", "lo", "up")
            self._do(0, "ip", "address", "add", f"{HUB}/32", "dev", "lo")
            for place in range(1, self._spokes + 1):
                self._join(place)
        except BaseException:
            self.__exit__()
            raise
        return self

    def __exit__(self, *_) -> None:
        # A namespace ends with the last process in it.
        for holder in self._holders:
            holder.kill()
            holder.wait()

    def words(self, place: int, *words: str) -> list[str]:
        """A command line, to be carried out at a place."""
        return ["nsenter", "--target", str(self._holders[place].pid), "--net", "--", *words]

    def cut(self, place: int) -> None:
        """Let nothing through to a spoke or back from now on, without a word to either end."""
        self._do(0, "ip", "link", "set", f"spoke{place}", "down")

    def _hold(self) -> None:
        """A new namespace, and a process that keeps it."""
        here = Path("/proc/self/ns/net").readlink()
        words = ["unshare", "--net", "sleep", "infinity"]
        holder = subprocess.Popen(words, stderr=subprocess.PIPE, text=True)
        assert holder.stderr is not None
        while holder.poll() is None:
            if Path(f"/proc/{holder.pid}/ns/net").readlink() != here:
                self._holders.append(holder)
                return
        raise NoNetwork(holder.stderr.read().strip() or "unshare ended")

    def _join(self, place: int) -> None:
        """A line between the hub and a spoke."""
        link, there = f"spoke{place}", str(self._holders[place].pid)
        peer = ("type", "veth", "peer", "name", "hub", "netns", there)
        self._do(0, "ip", "link", "add", link, *peer)
        self._do(0, "ip", "address", "add", f"10.77.{place}.1/24", "dev", link)
        self._do(0, "ip", "link", "set", link, "up")
        self._do(place, "ip", "address", "add", f"10.77.{place}.2/24", "dev", "hub")
        self._do(place, "ip", "link", "set", "hub", "up")
        self._do(place, "ip", "route", "add", "default", "via", f"10.77.{place}.1")

    def _do(self, place: int, *words: str) -> None:
        done = subprocess.run(self.words(place, *words), capture_output=True, text=True)
        if done.returncode:
            raise NoNetwork(f"{' '.join(words)}: {done.stderr.strip()}")
