"""Compiled code that outlives the process, for the command line only."""

from pathlib import Path

from asmjax import paths


def enable_compilation_cache() -> Path | None:
    """Let JAX keep every compiled program on disk, and return the folder.

    Returns None and changes nothing where the folder cannot be written. Changes JAX's global
    configuration, so a library user must ask for it.
    """
    folder = paths.writable_dir(paths.jax_cache_dir())
    if folder is None:
        return None
    import jax

    jax.config.update("jax_compilation_cache_dir", str(folder))
    # The kernels are small and many: by default none takes long enough (1 s) to be kept.
    jax.config.update("jax_persistent_cache_min_compile_time_secs", 0.0)
    jax.config.update("jax_persistent_cache_min_entry_size_bytes", -1)
    return folder
