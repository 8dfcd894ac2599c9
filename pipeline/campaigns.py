"""What the verbs that take a campaign have in common: options, reading, and the model that is asked for."""

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TypeVar

import numpy as np

from chatter_core.effects import Effect, activate, effect_class
from chatter_core.errors import InvalidInput
from chatter_core.evidence import Campaign, CampaignModel, Responses, base_model, read_campaign
from chatter_core.evidence.belief import PRIORS, Belief
from chatter_core.evidence.cuts import machines_as_cut
from chatter_core.machine import MACHINE_FILE, Machine
from chatter_core.parameters import Array, Parameter
from chatter_core.reading import printable, shown
from chatter_core.stages import Stages
from chatter_core.tip import most_modes
from pipeline import model_file
from pipeline.configuration import EFFECTS_PATH, Words, compose_settings
from pipeline.fitted_cuts import marks, seen
from pipeline.idle_effects import remark_idle
from pipeline.modes import check_modes
from pipeline.settings import Cluster, Settings
from pipeline.shipped import EFFECTS
from pipeline.telling import remark
from pipeline.verbs.campaigns import CampaignOptions, JudgingOptions

Options = TypeVar("Options", bound=CampaignOptions)


@dataclass(frozen=True, kw_only=True)
class Asked:
    """What a verb works on.

    name: of the campaign, as it is told; model: what is asked for; belief: what is known of its parameters before the
    campaign; content: what it is made of; given: its file as it was named, None for machine.yaml as it stands; unseen:
    whether it was fitted to none of the campaign's cuts; cluster: where to compute.
    """

    name: str
    model: CampaignModel
    belief: Belief
    content: model_file.Content
    given: str | None
    unseen: bool
    cluster: Cluster


@dataclass(frozen=True, kw_only=True)
class Standstill:
    """A base model whose bearings never turn: a term without parameters, which acts before all others."""

    @property
    def parameters(self) -> tuple[Parameter, ...]:
        """None."""
        return ()

    def apply(self, stages: Stages, values: Array) -> Stages:
        """Return the stages with the balls at rest."""
        return replace(stages, bearing_speed=_no_speed)


def _no_speed(spindle_speed: Array, modal_parameters: str) -> Array:
    return np.zeros_like(spindle_speed)


def options_of(words: Words, kind: type[Options]) -> Options:
    """Return the options of a verb.

    Raises InvalidInput for a missing or wrong option, and for words that belong to other verbs: the campaign's
    own machine is taken.
    """
    foreign = [*(key for key in words.choices if key != "cluster"), *(["machine"] if words.machine_file else [])]
    keys = [word.partition("=")[0] for word in words.values]
    foreign += [key for key in keys if key.split(".")[0] not in ("cluster", EFFECTS)]
    if foreign:
        instead = f"not for {kind.verb()}, which takes the campaign's own machine.yaml"
        raise InvalidInput([f"{word}: {instead}" for word in foreign])
    options = kind.read(words.options)
    if options.model is not None:
        given = [key for key in ("base", "modes", EFFECTS) if key in words.options]
        if given:
            raise InvalidInput([f"{key}: not beside model, whose file says it" for key in given])
    return options


def read(options: CampaignOptions, words: Words) -> Asked:
    """Return the model that is asked for, and everything beside it.

    What the reader found odd is told.

    Raises InvalidInput with the findings of all files.
    """
    campaign = read_campaign(options.campaign)
    settings = _settings_of(words, options.campaign / MACHINE_FILE)
    unseen = True
    if options.model is not None:
        found = model_file.read(options.model, campaign.machine, settings.effects_path)
        content = found.content(settings.effects_path)
        known = seen(campaign, found.fitted_cuts, found.fitted_measurements)
        unseen = frozenset(marks(campaign)).isdisjoint(found.fitted_cuts)
        if known and isinstance(options, JudgingOptions):
            campaign = replace(campaign, remarks=(*campaign.remarks, known))
    else:
        content = _content_of(options, settings)
    with _told_of(options.model):
        model = _usable_model(campaign, content)
    if options.model is not None:
        belief = model_file.belief_of(found, options.model, model)
    else:
        belief = _as_configured(settings)
    model = _tried(model, belief)
    for line in remarks(campaign):
        remark(line)
    remark_idle(content.effects, at_rest=content.base == "static_bearing", modes=model.available(model.cut_modes))
    name = printable(options.campaign.resolve().name)
    given = None if options.model is None else printable(str(options.model))
    return Asked(
        name=name,
        model=model,
        belief=belief,
        content=content,
        given=given,
        unseen=unseen,
        cluster=settings.cluster,
    )


def _tried(model: CampaignModel, belief: Belief) -> CampaignModel:
    """Return a model that forgives laws of the user's own what a fit may ask of them, once they have answered.

    Raises InvalidInput where one of them fails as it is believed to be.
    """
    if any(isinstance(term, Effect) and term.own_file is not None for term in model.terms):
        model.predict(belief.about(model).estimate)
    return replace(model, forgiving=True)


def _settings_of(words: Words, machine_file: Path) -> Settings:
    """Return the settings that the words make on the campaign's own machine."""
    return compose_settings(
        replace(
            words,
            options={key: said for key, said in words.options.items() if key in (EFFECTS, EFFECTS_PATH)},
            machine_file=machine_file,
        )
    )


@contextmanager
def _told_of(model: Path | None) -> Iterator[None]:
    """Tell what is wrong with a model by the file that it is from, if it is from one."""
    try:
        yield
    except InvalidInput as error:
        if model is None:
            raise
        raise InvalidInput([f"{model}: {problem}" for problem in error.problems]) from None


def _usable_model(campaign: Campaign, content: model_file.Content) -> CampaignModel:
    """Return the model of a campaign that has a base and effects.

    Raises InvalidInput when base, modes or effects are not for the machine.
    """
    model = model_of(campaign, content)
    check_modes(model.campaign.machine, model.available(model.cut_modes), "modes")
    for term in model.terms:
        if isinstance(term, Effect):
            require(term, campaign)
    return model


def model_of(campaign: Campaign, content: model_file.Content) -> CampaignModel:
    """Return the model of a campaign that has a base and effects.

    Raises InvalidInput when base or modes are not for the machine.
    """
    _require_parts(campaign.machine, content)
    own = content.effects_path
    effects = [effect_class(name, own)(**settings) for name, settings in content.effects.items()]
    effects.sort(key=lambda effect: effect.place())
    model = base_model(campaign, tuple(effects))
    if content.base == "static_bearing":
        model = replace(model, terms=(Standstill(), *model.terms))
    if content.modes is not None:
        model = replace(model, cut_modes=content.modes, receptance_modes=content.modes)
    return model


def require(effect: Effect, campaign: Campaign) -> None:
    """Raise InvalidInput where an effect can act neither on the machine nor on any of its cuts.

    Trials may state a process of their own.
    """
    refusals = list[InvalidInput]()
    for machine in [campaign.machine, *machines_as_cut(campaign)]:
        try:
            return effect.require(machine)
        except InvalidInput as error:
            refusals.append(error)
    raise refusals[0]


def _require_parts(machine: Machine, content: model_file.Content) -> None:
    """Raise InvalidInput where a machine of measured tip modes has not what is asked of it."""
    if machine.tip is None:
        return
    if content.base == "static_bearing":
        raise InvalidInput(["base: static_bearing holds bearings at rest; this machine has measured tip modes instead"])
    most = most_modes(machine.tip)
    if content.modes is not None and content.modes > most:
        raise InvalidInput([f"modes: found {content.modes}, allowed: 1 to {most}, as many as were measured of an axis"])


def settings_of(effect: Effect) -> dict[str, str | int]:
    """Return what was chosen of an effect."""
    return {setting.name: getattr(effect, setting.name) for setting in effect.settings}


def _content_of(options: CampaignOptions, settings: Settings) -> model_file.Content:
    """Return what the model is made of that the command line names."""
    own = settings.effects_path
    effects = {
        name: {setting.name: values[setting.name] for setting in effect_class(name, own).settings}
        for name, values in settings.effects.items()
    }
    return model_file.Content(base=options.base, modes=options.modes, effects=effects, effects_path=own)


def _as_configured(settings: Settings) -> Belief:
    """Return the configured sizes of effects, as surely as one states them."""
    configured, own = settings.effects, settings.effects_path
    if not configured:
        return PRIORS
    active = [activate(name, values, own) for name, values in configured.items()]
    parameters = [parameter for one in active for parameter in one.effect.parameters]
    return Belief(
        names=tuple(parameter.name for parameter in parameters),
        estimate=np.concatenate([one.values for one in active]),
        deviation=np.array([parameter.searched_by for parameter in parameters]),
        correlation=np.eye(len(parameters)),
    )


def remarks(measured: Campaign | Responses) -> list[str]:
    """Return what the reader of a campaign, or of a file of responses, has to tell."""
    told = [f"remark: {remark}" for remark in measured.remarks]
    return told + [f"unknown column, not used: {shown(column)}" for column in measured.unknown_columns]
