"""FastCycle for Python: read recordings, talk to running applications.

    import fastcycle

    with fastcycle.Log("drive.mcap") as log:
        frame = log.frame("localization/ego", ["x_m", "speed_mps"])

    with fastcycle.connect() as application:
        for message in application.subscribe("localization/ego"):
            print(message.time, message.message.speed_mps)
"""

from fastcycle._fastcycle import version as __version__
from fastcycle.application import Application, RunningApplication, connect, running_applications
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
