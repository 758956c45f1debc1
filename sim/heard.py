"""What MuJoCo warned of in this thread: kept for the verdict instead of printed and logged to the user's folder."""

from __future__ import annotations

import threading

_THREAD = threading.local()


def listen() -> None:
    """Make MuJoCo's warnings come here. Without this it appends them to MUJOCO_LOG.TXT in the working folder."""
    import mujoco

    mujoco.set_mju_user_warning(_hear)


def heard() -> tuple[str, ...]:
    """Return the different warnings since the last call in this thread, and forget them."""
    messages: list[str] = getattr(_THREAD, "messages", [])
    _THREAD.messages = []
    return tuple(dict.fromkeys(messages))


def _hear(message: str) -> None:
    if not hasattr(_THREAD, "messages"):
        _THREAD.messages = []
    _THREAD.messages.append(message)
