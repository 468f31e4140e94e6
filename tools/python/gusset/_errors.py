"""Exceptions of the package."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from ._folder import Run

MEANINGS = {
    1: "stopped by a limit or a failed check",
    2: "wrong usage or bad configuration; nothing moved",
    3: "a specimen or its link failed",
    4: "real-time conditions were required and not granted; nothing moved",
    5: "internal error",
    130: "interrupted by the operator",
    143: "ended by SIGTERM",
}


class GussetError(Exception):
    """Base of the exceptions of this package."""


class UsageError(GussetError, ValueError):
    """A call that cannot work, for example with an unknown specimen. Nothing was started."""


class RunError(GussetError):
    """A test that did not complete. If a specimen in Python raised an exception, it is the cause of this one.

    Attributes:
        code: Exit code of `gusset run`, see `gusset guide limits`.
        reason: Why the test ended.
        run: The run folder as a `Run`, or None if the test ended before it had one.
        messages: Everything that `gusset run` wrote to stderr.
    """

    def __init__(self, code: int, reason: str, run: Run | None, messages: str) -> None:
        self.code, self.reason, self.run, self.messages = code, reason, run, messages
        meaning = MEANINGS.get(code, "ended by a signal" if code < 0 else "failed")
        place = f"\nRun folder: {run.folder}" if run is not None else ""
        super().__init__(f"exit code {code} ({meaning}): {reason}{place}")

    def __reduce__(self) -> tuple[Any, ...]:
        """For `multiprocessing`: the arguments, not the text."""
        return RunError, (self.code, self.reason, self.run, self.messages)


class Interrupted(KeyboardInterrupt):
    """Ctrl-C stopped the test in an orderly way.

    Attributes:
        code: Exit code of `gusset run`, 130 as a rule.
        run: The complete run folder as a `Run`, or None if the test had none yet.
    """

    def __init__(self, code: int, run: Run | None) -> None:
        self.code, self.run = code, run
        place = f"; run folder: {run.folder}" if run is not None else ""
        super().__init__(f"the test was stopped by Ctrl-C{place}")

    def __reduce__(self) -> tuple[Any, ...]:
        """For `multiprocessing`: the arguments, not the text."""
        return Interrupted, (self.code, self.run)
