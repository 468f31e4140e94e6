"""Gusset from Python: run hybrid tests, read them as NumPy arrays, and write specimens in Python.

    import gusset

    run = gusset.run("test.toml", clock="simulated", set={"integrator.lambda": 4})
    run.time, run["disp", 3], run.specimen("column").force     # s, m and N, mapped from the run folder
    run.plot("test.png")

    campaign = gusset.campaign("study.toml")                   # many simulated tests, on all cores
    campaign["max_drift"], campaign.fragility.median

All quantities are in SI units. `gusset guide python` has examples.
"""

from __future__ import annotations

from importlib import metadata as _metadata

from ._binary import MissingBinary, binary
from ._campaign import Campaign, Fragility, TableColumn, campaign, open_campaign
from ._check import Check, Finding, check
from ._errors import CampaignError, GussetError, Interrupted, RunError, UsageError
from ._execute import run
from ._folder import Column, FolderError, Run, RunSpecimen, open
from .specimen import Rig, Server, Specimen, SpecimenError, serve

try:
    __version__ = _metadata.version("gusset-rths")
except _metadata.PackageNotFoundError:  # used from the source tree, without installation
    __version__ = "0"

__all__ = [
    "Campaign",
    "CampaignError",
    "Check",
    "Column",
    "Finding",
    "FolderError",
    "Fragility",
    "GussetError",
    "Interrupted",
    "MissingBinary",
    "Rig",
    "Run",
    "RunError",
    "RunSpecimen",
    "Server",
    "Specimen",
    "SpecimenError",
    "TableColumn",
    "UsageError",
    "binary",
    "campaign",
    "check",
    "open",
    "open_campaign",
    "run",
    "serve",
]
