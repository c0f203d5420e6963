"""Which files are opened: by this process, through an audit hook of Python, which hears of all;
and by a child, through a library before the C library, which sees what native code opens.
"""

import os
import shutil
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

_watchers: list[list[str]] = []


def _hear(event: str, arguments: tuple) -> None:
    # A hook stays for the life of the process.
    if _watchers and event == "open" and isinstance(arguments[0], str | bytes):
        for opened in _watchers:
            opened.append(os.path.abspath(os.fsdecode(arguments[0])))


sys.addaudithook(_hear)


@contextmanager
def opened_files() -> Iterator[list[str]]:
    """The paths that are opened within."""
    opened: list[str] = []
    _watchers.append(opened)
    try:
        yield opened
    finally:
        _watchers.remove(opened)


SOURCE = r"""
#define _GNU_SOURCE
#include <dlfcn.h>
#include <fcntl.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

static void tell(const char *path) {
    static int log = -2;
    if (log == -2) {
        int (*plain)(const char *, int, ...) = dlsym(RTLD_NEXT, "open");
        const char *name = getenv("ASMJAX_OPENS");
        log = name ? plain(name, O_WRONLY | O_APPEND | O_CREAT, 0600) : -1;
    }
    if (log < 0 || !path) return;
    char line[8192];
    int length = snprintf(line, sizeof line, "%s\n", path);
    if (length > 0 && write(log, line, strnlen(line, sizeof line)) < 0) return;
}

#define OPENS(name)                                                       \
    int name(const char *path, int flags, ...) {                          \
        int (*plain)(const char *, int, ...) = dlsym(RTLD_NEXT, #name);   \
        va_list more; va_start(more, flags);                              \
        int mode = va_arg(more, int); va_end(more);                       \
        tell(path); return plain(path, flags, mode);                      \
    }
#define OPENS_AT(name)                                                        \
    int name(int at, const char *path, int flags, ...) {                      \
        int (*plain)(int, const char *, int, ...) = dlsym(RTLD_NEXT, #name);  \
        va_list more; va_start(more, flags);                                  \
        int mode = va_arg(more, int); va_end(more);                           \
        tell(path); return plain(at, path, flags, mode);                      \
    }
#define OPENS_FILE(name)                                                          \
    FILE *name(const char *path, const char *mode) {                              \
        FILE *(*plain)(const char *, const char *) = dlsym(RTLD_NEXT, #name);     \
        tell(path); return plain(path, mode);                                     \
    }
OPENS(open) OPENS(open64) OPENS_AT(openat) OPENS_AT(openat64) OPENS_FILE(fopen) OPENS_FILE(fopen64)
"""


def listener(folder: Path) -> dict[str, str] | None:
    """Environment of a child whose opens are written to the file `ASMJAX_OPENS` names, a path a
    line; None without a C compiler."""
    compiler = shutil.which("gcc") or shutil.which("cc")
    if compiler is None:
        return None
    source, library = folder / "listener.c", folder / "listener.so"
    source.write_text(SOURCE)
    subprocess.run([compiler, "-shared", "-fPIC", "-O1", "-o", library, source, "-ldl"], check=True)
    return {"LD_PRELOAD": str(library), "ASMJAX_OPENS": str(folder / "opens")}


OWN = (os.devnull, "/proc/meminfo", *(f"/proc/self/{x}" for x in ("clear_refs", "statm", "status")))
"""What the two processes open for themselves: to tell how much memory there is."""


def foreign(opened: list[str], *outside: Path) -> list[str]:
    """What of these no scene may have opened."""
    places = (*map(str, outside), "/etc", "/dev", "/proc")
    return [path for path in opened if path.startswith(places) and path not in OWN]


class Opens:
    """What a child with the environment of `listener` has opened since `forget`."""

    def __init__(self, file: Path):
        self._file, self._from = file, 0

    def forget(self) -> None:
        self._from = self._file.stat().st_size if self._file.exists() else 0

    def paths(self) -> list[str]:
        """Absolute; names without a folder are those of the root, where children run."""
        if not self._file.exists():  # a scene that the scan refuses reaches no child
            return []
        with self._file.open("rb") as file:
            file.seek(self._from)
            lines = file.read().splitlines()
        return [os.path.normpath(os.path.join("/", os.fsdecode(line))) for line in lines]
