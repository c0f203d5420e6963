"""Counting how often JAX traces a function: after a warm-up, never."""

import contextlib
from collections.abc import Iterator

import jax

TRACED = "/jax/core/compile/jaxpr_trace_duration"


@contextlib.contextmanager
def counted_traces() -> Iterator[list[str]]:
    """A list that grows by one name for each function traced inside the `with` block."""
    seen: list[str] = []

    def listen(event: str, duration_secs: float, **facts) -> None:
        if event == TRACED:
            seen.append(str(facts.get("fun_name", "?")))

    jax.monitoring.register_event_duration_secs_listener(listen)
    try:
        yield seen
    finally:
        jax.monitoring.unregister_event_duration_listener(listen)
