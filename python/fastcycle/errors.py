"""The exceptions of the package."""

from __future__ import annotations


class Error(Exception):
    """What every other error of the package is."""


class NotFoundError(Error, KeyError):
    """A topic, field, parameter or service that there is not.

    The text names those that there are, or the nearest one.
    """

    def __str__(self) -> str:  # That of KeyError is quoted.
        return str(self.args[0]) if self.args else ""


class LogError(Error):
    """A file of a recording is damaged, or cannot be read.

    The text says file, byte, record, what was expected and what was found.
    """


class LogWarning(UserWarning):
    """A recording was cut off. What there is of it is read."""


class ApplicationError(Error):
    """A running application refused something, or the connection to it has ended.

    Attributes:
        hint: What to do about it, as the application says; may be empty.
        kind: `not_allowed`, `not_found`, `refused`, `late`, ...; `unknown` if there is nobody to
            talk to, or not any more.
    """

    KINDS = (
        "unknown",
        "malformed",
        "version",
        "not_allowed",
        "not_found",
        "refused",
        "too_many",
        "too_slow",
        "late",
    )

    def __init__(self, text: str, hint: str = "", kind: int = 0) -> None:
        super().__init__(f"{text} ({hint})" if hint else text)
        self.hint = hint
        self.kind = self.KINDS[kind] if 0 <= kind < len(self.KINDS) else "unknown"
