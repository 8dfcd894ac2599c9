"""What was measured on a machine, and what it says about the model of that machine."""

from chatter_core.evidence.campaign import Campaign, read_campaign, read_responses
from chatter_core.evidence.measured import Responses

__all__ = ["Campaign", "Responses", "read_campaign", "read_responses"]
