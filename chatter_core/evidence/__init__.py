"""What was measured on a machine, and what it says about the model of that machine."""

from chatter_core.evidence.calibration import calibrate
from chatter_core.evidence.campaign import Campaign, read_campaign, read_responses
from chatter_core.evidence.comparison import Comparison
from chatter_core.evidence.fit import Fit
from chatter_core.evidence.measured import Responses
from chatter_core.evidence.prediction import CampaignModel, base_model

__all__ = [
    "Campaign",
    "CampaignModel",
    "Comparison",
    "Fit",
    "Responses",
    "base_model",
    "calibrate",
    "read_campaign",
    "read_responses",
]
