"""Compile once what all processes of the tests call: python -m tests.compiling. Each would do so for itself.

What is kept beside the sources is found by whoever calls it next; what is missing here is compiled when it is called.
"""

from pathlib import Path

import numpy as np

from chatter_core.evidence import Comparison, base_model, read_campaign
from chatter_core.evidence.candidates import extended
from pipeline.diagnosis import candidates_of
from pipeline.model_file import Content

CAMPAIGN = Path(__file__).parent / "data" / "campaigns" / "d05"
#: Effects that call what others do not: on velocities, on chips that hang on their thickness, on the motion of a cut.
EFFECTS = ("process_damping", "chip_thickness_power_law", "tool_runout")


def main() -> None:
    """Evaluate a campaign by models that between them call what is compiled, and once from nearby."""
    base = Comparison(model=base_model(read_campaign(CAMPAIGN)))
    candidates = {one.name: one for one in candidates_of(base.model, Content())}
    for added in ([], *([candidates[name]] for name in EFFECTS)):
        comparison = extended(base, added)
        strong = {p.name: p.aside(0.3) for one in added for p in one.amplitudes}
        values = np.array([strong.get(p.name, p.null) for p in comparison.parameters])
        near = comparison.evaluate(values)
        comparison.evaluate(values + 1e-3 * np.array([p.touches == "cut" for p in comparison.parameters]), near)


if __name__ == "__main__":
    main()
