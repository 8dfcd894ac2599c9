"""What was measured on a machine, and what it says about the model of that machine."""

from chatter_core.evidence.campaign import Campaign, read_campaign

__all__ = ["Campaign", "read_campaign"]
