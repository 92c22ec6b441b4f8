"""FastCycle for Python: read recordings, talk to running applications.

    import fastcycle

    with fastcycle.Log("drive.mcap") as log:
        frame = log.frame("localization/ego", ["x_m", "speed_mps"])

    with fastcycle.connect() as application:
        for message in application.subscribe("localization/ego"):
            print(message.time, message.message.speed_mps)
"""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from fastcycle._fastcycle import version as __version__
    from fastcycle.application import (
        Application,
        RunningApplication,
        connect,
        running_applications,
    )
    from fastcycle.errors import ApplicationError, Error, LogError, LogWarning, NotFoundError
    from fastcycle.log import Log, Topic
    from fastcycle.messages import Message

__all__ = [
    "Application",
    "ApplicationError",
    "Error",
    "Log",
    "LogError",
    "LogWarning",
    "Message",
    "NotFoundError",
    "RunningApplication",
    "Topic",
    "__version__",
    "connect",
    "running_applications",
]

# A component that is written in Python needs none of this: it is imported when it is asked for.
_NAMES = {
    "application": ["Application", "RunningApplication", "connect", "running_applications"],
    "errors": ["ApplicationError", "Error", "LogError", "LogWarning", "NotFoundError"],
    "log": ["Log", "Topic"],
    "messages": ["Message"],
}


def __getattr__(name: str) -> Any:
    if name == "__version__":
        return importlib.import_module("fastcycle._fastcycle").version
    for module, names in _NAMES.items():
        if name == module:
            return importlib.import_module(f"fastcycle.{module}")
        if name in names:
            value = getattr(importlib.import_module(f"fastcycle.{module}"), name)
            globals()[name] = value
            return value
    raise AttributeError(f"module 'fastcycle' has no attribute {name!r}")


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})
