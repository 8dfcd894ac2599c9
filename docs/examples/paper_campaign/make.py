"""Draw the campaign of the tutorial: a shop that measures the reference machine, whose data sheet errs a little.

    python docs/examples/paper_campaign/make.py FOLDER

writes machine.yaml, stability.csv and frf.csv into FOLDER. What the shop measures comes from the program's own full
model (bearings whose balls feel their inertia, four modes of an axis in the cut, twenty in a receptance), with noise.
"""

import csv
import sys
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import yaml

from chatter_core.evidence import Campaign, CampaignModel, base_model
from chatter_core.evidence.columns import NO_WORD
from chatter_core.evidence.measured import Receptance, Trials
from chatter_core.evidence.nuisances import SENSOR
from chatter_core.evidence.prediction import Prediction
from chatter_core.machine import Machine
from chatter_core.tip import AXES
from chatter_core.units import si_factor
from pipeline.configuration import compose_settings, sort_words

SEED = 1
RPM, HERTZ, MILLIMETRE = (si_factor(f"x_{unit}") for unit in ("rpm", "hz", "mm"))
RECEPTANCE_UNIT = si_factor("x_um_n")
#: Ln of the factors by which the machine differs from its data sheet.
OFF_THE_SHEET = {
    "specific_cutting_energy": 0.06,
    "kn": -0.07,
    "damping": 0.09,
    "shaft_stiffness": -0.01,
    "preload": 0.05,
}
#: Speeds of the cuts, and depths, of which the shop tries one after the other at a speed.
SPEEDS_RPM = np.arange(5000.0, 18001.0, 1300.0)
DEPTHS_MM = np.round(0.65 * 1.4 ** np.arange(7), 2)
#: Cuts at a speed after the first that chatters.
BEYOND = 1
#: Share of wrong labels, and of chatter whose frequency nobody noted; error of a frequency as a share of it.
MISLABELLED, UNHEARD, FREQUENCY_ERROR = 0.03, 0.1, 0.003
#: Width in ln(depth) of the transition from stable to chatter.
TRANSITION = 0.05
#: Speeds, at rest as most shops measure them, and lines of the receptances; noise of a line as a share of its size,
#: and of the largest.
FRF_RPM = (0.0,)
LINES_HZ = np.arange(200.0, 2600.1, 15.0)
LINE_NOISE, FLOOR_NOISE = 0.02, 0.01


def make(folder: Path) -> None:
    """Write the campaign's files into a folder."""
    machine = compose_settings(sort_words([], ())).machine
    model = base_model(planned(machine))
    rng = np.random.default_rng(SEED)
    prediction = model.predict(truth(model, rng))
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "machine.yaml").write_text(yaml.safe_dump(machine.described(), sort_keys=False))
    write(folder / "frf.csv", receptance_rows(model.campaign.receptances, prediction, rng))
    write(folder / "stability.csv", trial_rows(prediction, rng))


def planned(machine: Machine) -> Campaign:
    """Return everything that the shop might measure: all depths at all speeds, and the lines of the receptances."""
    speed, depth = (grid.ravel() for grid in np.meshgrid(SPEEDS_RPM * RPM, DEPTHS_MM * MILLIMETRE, indexing="ij"))
    everywhere, nothing = np.ones(len(speed)), np.full(len(speed), np.nan)
    trials = Trials(
        trial=np.arange(len(speed)),
        spindle_speed=speed,
        axial_depth=depth,
        outcome=np.zeros(len(speed), dtype=np.int8),
        # A frequency that was heard makes the model say one.
        chatter_frequency=everywhere,
        preload=nothing,
        radial_immersion=nothing,
        feed_per_tooth=nothing,
        direction=np.full(len(speed), NO_WORD, dtype=np.int8),
        unknown={},
    )
    receptances = tuple(
        Receptance(
            source="frf.csv",
            spindle_speed=rpm * RPM,
            output_axis=axis,
            input_axis=axis,
            frequency=LINES_HZ * HERTZ,
            value=np.ones(len(LINES_HZ), dtype=complex),
        )
        for rpm in FRF_RPM
        for axis in range(len(AXES))
    )
    return Campaign(
        machine=machine,
        trials=trials,
        receptances=receptances,
        natural_frequencies=None,
        stiffness=None,
        limits=None,
        remarks=(),
        unknown_columns=(),
    )


def truth(model: CampaignModel, rng: np.random.Generator) -> np.ndarray:
    """Return the true values of the model's parameters; gain, phase and frequency axis of each sensor are drawn."""
    sensors = {name: width for name, _, _, width in SENSOR}
    values = []
    for parameter in model.parameters:
        kind = parameter.name.rpartition("_")[2]
        drawn = sensors[kind] * rng.standard_normal() if parameter.name.startswith("receptance_") else 0.0
        values.append(OFF_THE_SHEET.get(parameter.name, drawn))
    return np.array(values)


def trial_rows(prediction: Prediction, rng: np.random.Generator) -> Iterator[dict[str, object]]:
    """Yield the cuts of the shop: at each speed deeper and deeper until it chatters, and once beyond.

    Speeds come in an order drawn by chance. Chatter is drawn with probability F(margin / width), F logistic; after
    that labels are written down wrongly and frequencies with an error, or not at all.
    """
    shape = (len(SPEEDS_RPM), len(DEPTHS_MM))
    margin, frequency = prediction.margin.reshape(shape), prediction.chatter_frequency.reshape(shape) / HERTZ
    trial = 0
    for row in rng.permutation(len(SPEEDS_RPM)):
        chatters = rng.random(shape[1]) < 1.0 / (1.0 + np.exp(-margin[row] / TRANSITION))
        first = int(chatters.argmax()) if chatters.any() else shape[1]
        for column in range(min(first + BEYOND + 1, shape[1])):
            trial += 1
            heard = rng.random() >= UNHEARD and chatters[column]
            noted = frequency[row, column] * (1.0 + FREQUENCY_ERROR * rng.standard_normal())
            wrong = rng.random() < MISLABELLED
            yield {
                "trial": trial,
                "spindle_speed_rpm": f"{SPEEDS_RPM[row]:.0f}",
                "axial_depth_mm": f"{DEPTHS_MM[column]:.2f}",
                "outcome": "chatter" if chatters[column] != wrong else "stable",
                "chatter_frequency_hz": f"{noted:.1f}" if heard and not wrong else "",
            }


def receptance_rows(
    planned: tuple[Receptance, ...], prediction: Prediction, rng: np.random.Generator
) -> Iterator[dict[str, object]]:
    """Yield the lines of the receptances, with noise on both parts."""
    for one, exact in zip(planned, prediction.receptances, strict=True):
        deviation = np.hypot(LINE_NOISE * np.abs(exact), FLOOR_NOISE * np.abs(exact).max())
        real, imaginary = rng.standard_normal((2, len(exact)))
        value = (exact + deviation * (real + 1j * imaginary)) / RECEPTANCE_UNIT
        for frequency, line in zip(LINES_HZ, value, strict=True):
            yield {
                "spindle_speed_rpm": f"{one.spindle_speed / RPM:.0f}",
                "frequency_hz": f"{frequency:.0f}",
                "output_axis": AXES[one.output_axis],
                "input_axis": AXES[one.input_axis],
                "real_um_n": f"{line.real:.5f}",
                "imag_um_n": f"{line.imag:.5f}",
            }


def write(path: Path, rows: Iterator[dict[str, object]]) -> None:
    """Write rows as a table."""
    listed = list(rows)
    with path.open("w", newline="") as file:
        table = csv.DictWriter(file, fieldnames=list(listed[0]), lineterminator="\n")
        table.writeheader()
        table.writerows(listed)


if __name__ == "__main__":
    make(Path(sys.argv[1]))
