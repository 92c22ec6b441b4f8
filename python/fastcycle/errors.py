"""The exceptions of the package."""

from __future__ import annotations


class Error(Exception):
    """Base class of the errors of the package."""


class NotFoundError(Error, KeyError):
    """A topic, field, parameter or service does not exist.

    The text lists the existing ones, or the nearest one.
    """

    def __str__(self) -> str:  # That of KeyError is quoted.
        return str(self.args[0]) if self.args else ""


class LogError(Error):
    """A file of a recording is damaged, or cannot be read.

    The text contains the file, the byte, the record, and what was expected and found.
    """


class LogWarning(UserWarning):
    """A recording was cut off. The part before that is read."""


class ApplicationError(Error):
    """A running application refused something, or the connection to it has ended.

    Attributes:
        hint: The application's advice; may be empty.
        kind: `not_allowed`, `not_found`, `refused`, `late`, ...; `unknown` if there is no
            connection.
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
