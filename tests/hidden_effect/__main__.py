"""Make one campaign: python -m tests.hidden_effect SEED FOLDER TRUTH_FOLDER."""

import argparse
from pathlib import Path

from tests.hidden_effect.campaign import make_campaign

parser = argparse.ArgumentParser(prog="python -m tests.hidden_effect", description=__doc__)
parser.add_argument("seed", type=int, help="seed of the campaign; see design.py for those of calibration and test")
parser.add_argument("folder", type=Path, help="folder for what the shop has")
parser.add_argument("truth_folder", type=Path, help="folder for the truth, apart from it")
arguments = parser.parse_args()
make_campaign(arguments.seed, arguments.folder, arguments.truth_folder)
