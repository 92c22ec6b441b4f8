"""What a run was: its options, its contenders, facts of the machine, and each time it was started."""

from __future__ import annotations

import json
import pathlib
from dataclasses import asdict, dataclass, field
from typing import Any

import facts
from contenders import Contender
from plan import Options


@dataclass
class Session:
    """One start of a run: a run that was interrupted has several."""

    begun: str
    load_before: list[float]
    ended: str = ""
    load_after: list[float] = field(default_factory=list)
    steal_s: float = 0.0
    seconds: float = 0.0


@dataclass
class RunRecord:
    options: Options
    command: str
    machine: dict[str, str]
    build: dict[str, str]
    packages: dict[str, str]
    contenders: list[Contender]
    missing: dict[str, str]  # who is not measured, and why
    sessions: list[Session] = field(default_factory=list)

    def write(self, file: pathlib.Path) -> None:
        text = asdict(self)
        text["contenders"] = [c.to_json() for c in self.contenders]
        file.write_text(json.dumps(text, indent=1) + "\n", encoding="utf-8")

    @staticmethod
    def read(file: pathlib.Path) -> RunRecord:
        text: dict[str, Any] = json.loads(file.read_text(encoding="utf-8"))
        options = text.pop("options")
        options.pop("peer_count", None)  # of older runs
        for name in ("sizes", "modes"):
            options[name] = tuple(options[name])
        contenders = [Contender.from_json(c) for c in text.pop("contenders")]
        sessions = [Session(**s) for s in text.pop("sessions")]
        return RunRecord(options=Options(**options), contenders=contenders, sessions=sessions, **text)

    def differs(self, other: RunRecord) -> str:
        """Why `other` is not a continuation of this run; empty if it is."""
        if self.options != other.options:
            return "with other options"
        if self.build != other.build:
            return f"of another build ({self.build['FastCycle']})"
        return ""


def begin() -> Session:
    return Session(facts.now(), facts.load_average())
