"""Exceptions of the package."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from ._campaign import Campaign
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


class CampaignError(GussetError):
    """A campaign that did not complete.

    Attributes:
        code: Exit code of `gusset campaign run`: 1 if results are missing or differ, 2 if the study or the folder is wrong.
        reason: Why the campaign ended.
        campaign: The campaign folder as a `Campaign`, or None if there is none.
        messages: Everything that `gusset campaign run` wrote to stderr.
    """

    def __init__(self, code: int, reason: str, campaign: Campaign | None, messages: str) -> None:
        self.code, self.reason, self.campaign, self.messages = code, reason, campaign, messages
        place = f"\nCampaign folder: {campaign.folder}" if campaign is not None else ""
        super().__init__(f"exit code {code}: {reason}{place}")

    def __reduce__(self) -> tuple[Any, ...]:
        """For `multiprocessing`: the arguments, not the text."""
        return CampaignError, (self.code, self.reason, self.campaign, self.messages)


class Interrupted(KeyboardInterrupt):
    """Ctrl-C stopped the test or the campaign in an orderly way.

    Attributes:
        code: Exit code of the program, 130 as a rule.
        run: The complete run folder as a `Run`; None if the test had none yet, and for a campaign.
        campaign: The campaign folder as a `Campaign`; None if there is none yet, and for a test.
    """

    def __init__(self, code: int, run: Run | None, campaign: Campaign | None = None) -> None:
        self.code, self.run, self.campaign = code, run, campaign
        if campaign is not None:
            text = f"Ctrl-C stopped the campaign; gusset.campaign({str(campaign.folder)!r}) continues it"
        elif run is not None:
            text = f"Ctrl-C stopped the test; run folder: {run.folder}"
        else:
            text = "stopped by Ctrl-C"
        super().__init__(text)

    def __reduce__(self) -> tuple[Any, ...]:
        """For `multiprocessing`: the arguments, not the text."""
        return Interrupted, (self.code, self.run, self.campaign)
