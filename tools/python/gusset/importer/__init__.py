"""Imports models of other programs: the work of `gusset import`, which calls `python -m gusset.importer OPTIONS`."""

from __future__ import annotations


class Refused(Exception):
    """A model that cannot be imported. The message says what was found, what is allowed and what to do."""
