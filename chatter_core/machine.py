"""What the user describes: bearing, spindle or measured tip, tool, cutting, process.

Keys carry the unit of the border (``pitch_diameter_mm``); attributes are SI
(``bearing.pitch_diameter`` in m). A key, its unit, its bounds and its meaning stand here and
nowhere else; values live in yaml. Geometry that no single key can judge (balls that do not fit,
a bearing beside the shaft) is checked by the validators at the end of each class.
"""

import itertools
import math
from typing import Any, Literal, Self

from pydantic import BaseModel, ConfigDict, Field, ValidationInfo, field_validator, model_validator

from chatter_core.cards import Card, ShownAsCard
from chatter_core.units import si_factor

#: Name of the file that describes the machine of a campaign.
MACHINE_FILE = "machine.yaml"
#: A position counts as on the shaft when it misses its end by less than this [m].
POSITION_TOLERANCE = 1e-9
#: Bearing seats are apart by this at least [m]; bores are this share of the outer diameter at most.
CLOSEST_SEATS, THINNEST_BORE = 1e-3, 0.999
#: Measured modes that a machine shows of itself.
MODES_SHOWN = 4
#: Bounds of the axial preload of a single bearing [N].
LEAST_PRELOAD, MOST_PRELOAD = 0.1, 1e6


def no_truth_value(value: Any) -> Any:
    """Return a value as it is; raise ValueError for true and false, which would pass as 1 and 0."""
    if isinstance(value, bool):
        raise ValueError(f"found {str(value).lower()}, a number or word is needed")
    return value


class Description(BaseModel):
    """Base of everything described: immutable, no unknown keys, finite, SI inside."""

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)

    @field_validator("*", mode="before")
    @classmethod
    def _no_truth_values(cls, value: Any) -> Any:
        return no_truth_value(value)

    @field_validator("*", mode="after")
    @classmethod
    def _to_si(cls, value: Any, info: ValidationInfo) -> Any:
        assert info.field_name is not None
        key = cls.model_fields[info.field_name].alias or info.field_name
        return value * si_factor(key) if isinstance(value, float) else value

    def described(self) -> dict[str, Any]:
        """Return the description as the user would write it: keys and units of the border."""
        return {
            (field.alias or name): _border_value(getattr(self, name), field.alias or name)
            for name, field in type(self).model_fields.items()
            if getattr(self, name) is not None
        }


def _border_value(value: Any, key: str) -> Any:
    if isinstance(value, Description):
        return value.described()
    if isinstance(value, tuple):
        return [_border_value(item, key) for item in value]
    # 15 digits: a value survives the way to SI and back as it was written.
    return float(f"{value / si_factor(key):.15g}") if isinstance(value, float) else value


class Material(Description):
    """Linear elastic, isotropic material."""

    youngs_modulus: float = Field(alias="youngs_modulus_gpa", ge=1e-3, le=2000, description="Young's modulus E")
    poisson_ratio: float = Field(ge=0, lt=0.5, description="Poisson's ratio")
    density: float = Field(alias="density_kg_m3", ge=1e-3, le=30000, description="mass density")

    @property
    def shear_modulus(self) -> float:
        """Shear modulus G = E / (2 (1 + nu)) [Pa]."""
        return self.youngs_modulus / (2.0 * (1.0 + self.poisson_ratio))


class Bearing(Description):
    """Angular contact ball bearing, as its data sheet describes it."""

    pitch_diameter: float = Field(alias="pitch_diameter_mm", ge=1, le=5000, description="pitch circle diameter d_m")
    ball_diameter: float = Field(alias="ball_diameter_mm", ge=0.1, le=500, description="ball diameter D_b")
    ball_count: int = Field(ge=3, le=500, description="number of balls N")
    contact_angle: float | None = Field(
        default=None, alias="contact_angle_deg", ge=0.1, lt=80, description="unloaded contact angle"
    )
    radial_clearance: float | None = Field(
        default=None,
        alias="radial_clearance_um",
        ge=-1000,
        le=1000,
        description="diametral clearance P_d instead of a contact angle; negative where the balls are pressed in",
    )
    inner_groove_conformity: float = Field(
        ge=0.501, le=1, description="inner groove radius over ball diameter, f_i (0.5: the groove would fit tightly)"
    )
    outer_groove_conformity: float = Field(
        ge=0.501, le=1, description="outer groove radius over ball diameter, f_o (0.5: the groove would fit tightly)"
    )
    ball: Material = Field(description="material of the balls")
    ring: Material = Field(description="material of both rings")
    raceway_control: Literal["outer", "inner", "hybrid"] = Field(
        default="outer", description="which race sets the ball's spin axis and holds its gyroscopic moment"
    )
    gyroscopic_moment: Literal["published", "rigid_body", "none"] = Field(
        default="published",
        description="sense of the balls' gyroscopic moment: as in published tables, as rigid-body dynamics, or none",
    )

    @property
    def unloaded_contact_angle(self) -> float:
        """Contact angle without load [rad]: as stated, or what the clearance leaves, cos a = 1 - P_d / (2 B D)."""
        if self.radial_clearance is None:
            assert self.contact_angle is not None
            return self.contact_angle
        play = max(0.0, self.radial_clearance)
        return math.acos(1.0 - play / (2.0 * self.groove_distance))

    @property
    def groove_distance(self) -> float:
        """Distance B D of the grooves' centres of curvature when a ball just touches both, B = f_i + f_o - 1 [m]."""
        return (self.inner_groove_conformity + self.outer_groove_conformity - 1.0) * self.ball_diameter

    @model_validator(mode="after")
    def _angle_or_clearance(self) -> Self:
        if (self.contact_angle is None) == (self.radial_clearance is None):
            found = "none of them" if self.contact_angle is None else "both"
            raise ValueError(f"a bearing takes either contact_angle_deg or radial_clearance_um; found: {found}")
        most = 2.0 * self.groove_distance * (1.0 - math.cos(math.radians(80.0)))
        if self.radial_clearance is not None and self.radial_clearance > most:
            raise ValueError(
                f"radial_clearance_um {self.radial_clearance * 1e6:g} leaves the balls without a contact angle: "
                f"allowed at most {most * 1e6:.0f}"
            )
        return self

    @model_validator(mode="after")
    def _balls_fit(self) -> Self:
        room = math.pi / math.asin(min(1.0, self.ball_diameter / self.pitch_diameter))
        if self.ball_count > room:
            raise ValueError(
                f"{self.ball_count} balls of {self.ball_diameter * 1e3:g} mm do not fit on a pitch circle of "
                f"{self.pitch_diameter * 1e3:g} mm: allowed at most {math.floor(room)}"
            )
        return self


class Section(Description):
    """Cylindrical piece of the rotor, counted from the tool tip."""

    part: str = Field(
        pattern=r"^[A-Za-z0-9 _.,+()/-]{1,64}$",
        description="what it belongs to: tool, holder, shaft, or a name of your own",
    )
    length: float = Field(alias="length_mm", ge=0.1, le=10000, description="length")
    outer_diameter: float = Field(alias="outer_diameter_mm", ge=0.1, le=2000, description="outer diameter")
    inner_diameter: float = Field(alias="inner_diameter_mm", default=0.0, ge=0, description="bore diameter")
    youngs_modulus: float = Field(alias="youngs_modulus_gpa", ge=1e-3, le=2000, description="Young's modulus E")
    poisson_ratio: float = Field(ge=0, lt=0.5, description="Poisson's ratio")
    density: float = Field(alias="density_kg_m3", ge=1e-3, le=30000, description="mass density")

    @model_validator(mode="after")
    def _is_hollow_at_most(self) -> Self:
        if self.inner_diameter > THINNEST_BORE * self.outer_diameter:
            raise ValueError(
                f"inner_diameter_mm {self.inner_diameter * 1e3:g} must be smaller than {THINNEST_BORE:g} times "
                f"outer_diameter_mm {self.outer_diameter * 1e3:g}"
            )
        return self


class Disc(Description):
    """Rigid disc on the rotor (pulley, motor rotor, clamping nut), added to the section below it."""

    position: float = Field(alias="position_mm", ge=0, description="distance of its middle from the tool tip")
    width: float = Field(alias="width_mm", ge=0.01, le=5000, description="axial width")
    outer_diameter: float = Field(alias="outer_diameter_mm", ge=0.1, le=5000, description="outer diameter")
    inner_diameter: float = Field(alias="inner_diameter_mm", ge=0, description="bore: the shaft's diameter there")
    density: float = Field(alias="density_kg_m3", ge=1e-3, le=30000, description="mass density")

    @model_validator(mode="after")
    def _has_material(self) -> Self:
        if self.inner_diameter >= self.outer_diameter:
            raise ValueError(
                f"inner_diameter_mm {self.inner_diameter * 1e3:g} must be smaller than "
                f"outer_diameter_mm {self.outer_diameter * 1e3:g}"
            )
        return self


class BearingSeat(Description):
    """Place on the shaft that carries one or more equal bearings."""

    position: float = Field(alias="position_mm", ge=0, description="distance from the tool tip")
    count: int = Field(default=1, ge=1, le=20, description="number of bearings side by side")


class Damping(Description):
    """Damping of the rotor on its bearings: proportional, C = c1 M + c2 K, or one modal ratio."""

    kind: Literal["proportional", "modal"] = Field(description="law of damping")
    mass_coefficient: float | None = Field(default=None, alias="mass_coefficient_1_s", ge=0, le=1e5, description="c1")
    stiffness_coefficient: float | None = Field(
        default=None, alias="stiffness_coefficient_s", ge=0, le=1e-3, description="c2"
    )
    ratio: float | None = Field(default=None, ge=1e-9, lt=1, description="damping ratio of every mode at every speed")

    @model_validator(mode="after")
    def _keys_belong_to_kind(self) -> Self:
        proportional = {
            "mass_coefficient_1_s": self.mass_coefficient,
            "stiffness_coefficient_s": self.stiffness_coefficient,
        }
        wanted, foreign = (proportional, {"ratio": self.ratio})
        if self.kind == "modal":
            wanted, foreign = foreign, wanted
        missing = [key for key, value in wanted.items() if value is None]
        extra = [key for key, value in foreign.items() if value is not None]
        if missing or extra:
            raise ValueError(
                f"damping of kind '{self.kind}' takes {', '.join(wanted)}"
                + (f"; missing: {', '.join(missing)}" if missing else "")
                + (f"; not allowed: {', '.join(extra)}" if extra else "")
            )
        return self


class Spindle(Description):
    """Rotor on angular contact bearings, from the tool tip (free end) backwards."""

    sections: tuple[Section, ...] = Field(min_length=1, max_length=1000, description="pieces, tip first")
    bearings: tuple[BearingSeat, ...] = Field(min_length=1, max_length=20, description="bearing seats")
    discs: tuple[Disc, ...] = Field(default=(), max_length=100, description="rigid discs")
    preload: float = Field(
        alias="preload_n", ge=LEAST_PRELOAD, le=MOST_PRELOAD, description="axial preload on every single bearing"
    )
    preload_type: Literal["constant", "rigid"] = Field(
        description="constant: a spring keeps the force; rigid: locked rings keep the displacement of standstill"
    )
    damping: Damping = Field(description="damping of the rotor on its bearings")
    beam: Literal["timoshenko", "euler_bernoulli"] = Field(default="timoshenko", description="beam theory")

    @property
    def length(self) -> float:
        """Length of the rotor [m]."""
        return sum(section.length for section in self.sections)

    @property
    def seat_places(self) -> tuple[float, ...]:
        """Place of every seat between the front one, 0, and the rearmost, 1."""
        positions = [seat.position for seat in self.bearings]
        front, rearmost = min(positions), max(positions)
        return tuple((position - front) / (rearmost - front) for position in positions)

    @model_validator(mode="after")
    def _seats_and_discs_on_the_rotor(self) -> Self:
        for key, places in (
            ("bearings", [seat.position for seat in self.bearings]),
            ("discs", [disc.position for disc in self.discs]),
        ):
            for index, place in enumerate(places):
                if place > self.length + POSITION_TOLERANCE:
                    raise ValueError(
                        f"{key}[{index}].position_mm {place * 1e3:g} lies outside the rotor, "
                        f"which ends at {self.length * 1e3:g} mm"
                    )
        positions = [seat.position for seat in self.bearings]
        places = sorted(positions)
        if any(second - first < CLOSEST_SEATS for first, second in itertools.pairwise(places)):
            raise ValueError(
                f"bearings: two seats are nearer than {CLOSEST_SEATS * 1e3:g} mm to each other; "
                "use count for bearings side by side"
            )
        if len(positions) < 2:
            raise ValueError("bearings: a rotor needs at least two seats, one alone lets it swing freely")
        return self


class TipMode(Description):
    """Mode measured at the tool tip."""

    axis: Literal["x", "y"] = Field(description="direction of the mode; x is the feed direction")
    natural_frequency: float = Field(alias="natural_frequency_hz", ge=0.1, le=1e6, description="natural frequency")
    natural_frequency_deviation: float | None = Field(
        default=None,
        alias="natural_frequency_deviation_hz",
        ge=0,
        le=1e6,
        description="standard deviation of natural_frequency_hz, where known",
    )
    damping_ratio: float = Field(ge=1e-9, lt=1, description="damping ratio")
    damping_ratio_deviation: float | None = Field(
        default=None, ge=0, le=1e6, description="standard deviation of damping_ratio, where known"
    )
    stiffness: float = Field(alias="stiffness_n_um", ge=1e-6, le=1e6, description="modal stiffness felt at the tip")
    stiffness_deviation: float | None = Field(
        default=None,
        alias="stiffness_deviation_n_um",
        ge=0,
        le=1e12,
        description="standard deviation of stiffness_n_um, where known",
    )
    spindle_speed: float | None = Field(
        default=None, alias="spindle_speed_rpm", ge=0, le=1e6, description="speed it was measured at, where known"
    )


class Tip(Description):
    """Tool tip known by its measured modes alone, instead of bearing and spindle."""

    modes: tuple[TipMode, ...] = Field(min_length=1, max_length=1000, description="modes of both axes")

    @model_validator(mode="after")
    def _speeds_are_complete(self) -> Self:
        stated = {mode.spindle_speed is not None for mode in self.modes}
        if len(stated) > 1:
            raise ValueError("tip.modes: give spindle_speed_rpm for every mode or for none")
        counts = {
            tuple(sum(m.axis == axis for m in self.modes if m.spindle_speed == speed) for axis in "xy")
            for speed in {mode.spindle_speed for mode in self.modes}
        }
        if len(counts) > 1:
            raise ValueError("tip.modes: every spindle_speed_rpm must list the same number of modes per axis")
        return self


class Tool(Description):
    """Milling cutter, its teeth equally spaced and long unless an effect says otherwise."""

    teeth: int = Field(ge=1, le=100, description="number of teeth Z")
    diameter: float = Field(alias="diameter_mm", ge=0.01, le=2000, description="cutting diameter")
    helix_angle: float = Field(alias="helix_angle_deg", ge=0, lt=80, description="helix angle eta")
    rake_angle: float = Field(alias="rake_angle_deg", gt=-60, lt=60, description="normal rake angle phi_n")


class Cutting(Description):
    """Cutting force coefficients of a workpiece material with a tool."""

    specific_cutting_energy: float = Field(alias="kt_mpa", ge=0.1, le=1e5, description="specific cutting energy k_t")
    kn: float = Field(ge=0, le=10, description="normal force over friction-free tangential force, k_n")
    friction_coefficient: float = Field(ge=0, le=5, description="friction coefficient mu on the rake face")


class Process(Description):
    """How the cutter meets the workpiece; feed along x."""

    direction: Literal["up", "down", "slot"] = Field(description="kind of milling")
    radial_immersion: float = Field(ge=1e-4, le=1, description="radial depth over tool diameter")
    feed_per_tooth: float = Field(alias="feed_per_tooth_mm", ge=1e-6, le=100, description="feed per tooth")

    @model_validator(mode="after")
    def _slot_is_full(self) -> Self:
        if self.direction == "slot" and self.radial_immersion != 1.0:
            raise ValueError(f"direction 'slot' needs radial_immersion 1, found {self.radial_immersion:g}")
        return self


class Machine(ShownAsCard, Description):
    """A machine and its cut: either bearing and spindle, or measured tip modes."""

    bearing: Bearing | None = Field(default=None, description="bearing type of every seat")
    spindle: Spindle | None = Field(default=None, description="rotor, seats, preload and damping")
    tip: Tip | None = Field(default=None, description="measured tip modes, instead of bearing and spindle")
    tool: Tool = Field(description="milling cutter")
    cutting: Cutting = Field(description="cutting force coefficients")
    process: Process = Field(description="immersion and feed")

    @model_validator(mode="after")
    def _one_source_of_modes(self) -> Self:
        built = self.bearing is not None and self.spindle is not None
        if built == (self.tip is not None) or (self.tip and (self.bearing or self.spindle)):
            found = [key for key in ("bearing", "spindle", "tip") if getattr(self, key) is not None]
            raise ValueError(
                f"a machine takes either bearing and spindle, or tip; found: {', '.join(found) or 'none of them'}"
            )
        return self

    def card(self) -> Card:
        """Return what people look for first, in the units of the shop."""
        tool, process = self.tool.described(), self.process.described()
        cut = (
            ("tool", f"{tool['teeth']} teeth, {tool['diameter_mm']:g} mm, helix {tool['helix_angle_deg']:g} deg"),
            ("cutting", ", ".join(f"{key} {value:g}" for key, value in self.cutting.described().items())),
            ("process", ", ".join(f"{key} {value}" for key, value in process.items())),
        )
        return Card(title="Machine", rows=(*self._rows_of_modes(), *cut))

    def _rows_of_modes(self) -> tuple[tuple[str, str], ...]:
        if self.bearing is None or self.spindle is None:
            modes = [mode.described() for mode in self.tip.modes] if self.tip else []
            told = ", ".join(f"{mode['axis']} {mode['natural_frequency_hz']:g} Hz" for mode in modes[:MODES_SHOWN])
            more = f" and {len(modes) - MODES_SHOWN} more" if len(modes) > MODES_SHOWN else ""
            return (("tip", f"measured modes: {told}{more}"),)
        bearing, spindle = self.bearing.described(), self.spindle.described()
        seats = ", ".join(f"{seat['count']} at {seat['position_mm']:g} mm" for seat in spindle["bearings"])
        balls = f"{bearing['ball_count']} balls of {bearing['ball_diameter_mm']:g} mm"
        length = self.spindle.length / si_factor("x_mm")
        return (
            ("bearings", f"{seats}; {balls} on {bearing['pitch_diameter_mm']:g} mm"),
            ("preload", f"{spindle['preload_n']:g} N on each, {spindle['preload_type']}"),
            ("rotor", f"{length:g} mm in {len(spindle['sections'])} sections"),
        )

    def with_preload(self, preload: float) -> "Machine":
        """Return the machine with another axial preload [N] on every single bearing."""
        assert self.spindle is not None, "a machine of measured tip modes has no preload"
        return self.model_copy(update={"spindle": self.spindle.model_copy(update={"preload": preload})})
