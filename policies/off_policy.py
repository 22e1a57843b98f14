"""The networks as stable-baselines3 policies for SAC and TD3."""

from __future__ import annotations

from typing import Any, ClassVar

import torch
from gymnasium import spaces
from stable_baselines3.common.distributions import SquashedDiagGaussianDistribution
from stable_baselines3.common.policies import BasePolicy
from stable_baselines3.common.preprocessing import get_action_dim
from stable_baselines3.common.torch_layers import BaseFeaturesExtractor
from stable_baselines3.common.type_aliases import PyTorchObs, Schedule
from stable_baselines3.sac.policies import SACPolicy
from stable_baselines3.td3.policies import TD3Policy
from torch import Tensor, nn

from bilateral_rl.policies.motor_network import MotorNetwork
from bilateral_rl.policies.motor_policy import Constrained, MotorPolicy, network_arguments
from bilateral_rl.policies.networks import make_network
from bilateral_rl.policies.quantities import finite, switch, whole, widths
from bilateral_rl.policies.sb3_arguments import NOT_AVAILABLE, available
from bilateral_rl.policies.stream_critics import StreamCritics
from bilateral_rl.vocabulary import Architecture

_STD_OF_SAVED = (0.0, -0.5)
"""Values of ``log_std_init`` that TD3's policies took and had no use for: saved models hold these defaults."""
LOG_STD_BOUNDS = (-20.0, 2.0)
"""Range of the log of the standard deviation, as in SB3's SAC."""


class MotorActor(Constrained, BasePolicy):
    """One of the paper's networks as SB3's actor: tanh of half the network's output.

    As sigmoid(z) = (tanh(z / 2) + 1) / 2, the action in [-1, 1] stands for the network's excitation in [0, 1].

    Args:
        observation_space: any space that SB3 flattens.
        action_space: a bounded Box.
        features_extractor: module that maps observations to features.
        features_dim: number of features.
        network: arguments of :func:`~bilateral_rl.policies.networks.make_network`.
        log_std_init: log of the initial standard deviation before the squashing, the same for every action and
            observation; None for a deterministic actor.
        normalize_images: whether to scale images to [0, 1], as SB3's policies do.
    """

    def __init__(
        self,
        observation_space: spaces.Space[Any],
        action_space: spaces.Box,
        features_extractor: BaseFeaturesExtractor,
        features_dim: int,
        network: dict[str, Any],
        log_std_init: float | None,
        normalize_images: bool = True,
    ) -> None:
        super().__init__(
            observation_space,
            action_space,
            features_extractor=features_extractor,
            normalize_images=normalize_images,
            squash_output=True,
        )
        n_actions = get_action_dim(action_space)
        self.network = make_network(n_inputs=features_dim, n_outputs=n_actions, **network)
        if log_std_init is not None:
            self.action_dist = SquashedDiagGaussianDistribution(n_actions)
            self.log_std = nn.Parameter(torch.full((n_actions,), float(log_std_init)))

    @property
    def motor_network(self) -> MotorNetwork:
        """The network."""
        return self.network

    def action_mean(self, obs: PyTorchObs) -> Tensor:
        """Return the mean of the Gaussian before the squashing, (n, n_actions), with fresh noise on hidden units."""
        features = self.extract_features(obs, self.features_extractor)
        noise = self.network.noise.draw(len(features), features.device)
        return self.network(features, noise) / 2  # type: ignore[no-any-return]

    def action_log_prob(self, obs: PyTorchObs) -> tuple[Tensor, Tensor]:
        """Sample actions (n, n_actions) in [-1, 1]; return them and the log of their density (n,)."""
        # SB3 samples u ~ N(mean, std), squashes a = tanh(u), and corrects the density for the squashing:
        # log p(a) = log N(u) - Σ log(1 - a² + 1e-6), by the change of variables da/du = 1 - tanh(u)².
        return self.action_dist.log_prob_from_params(self.action_mean(obs), self._bounded_log_std())

    def forward(self, obs: PyTorchObs, deterministic: bool = False) -> Tensor:
        """Return actions in [-1, 1], (n, n_actions): the mode, or samples if the actor is stochastic."""
        mean = self.action_mean(obs)
        if deterministic or not self.is_stochastic:
            return torch.tanh(mean)
        return self.action_dist.actions_from_params(mean, self._bounded_log_std())

    @property
    def is_stochastic(self) -> bool:
        """Whether the actor has a standard deviation to sample with."""
        return hasattr(self, "log_std")

    def _predict(self, observation: PyTorchObs, deterministic: bool = False) -> Tensor:
        return self(observation, deterministic)  # type: ignore[no-any-return]

    def _bounded_log_std(self) -> Tensor:
        return self.log_std.clamp(*LOG_STD_BOUNDS)


class BilateralOffPolicyPolicy(MotorPolicy):
    """Base class of the policies for SAC and TD3; mix it into one of SB3's.

    The deterministic action on muscles commanded in [-1, 1] is exactly the network's sigmoid output
    (see :class:`MotorActor`). The critics are SB3's, in one list: the first ``n_critics`` belong to the first stream,
    the next to the second.

    Args:
        observation_space: any space that SB3 flattens.
        action_space: a bounded Box.
        lr_schedule: learning rate by remaining progress.
        architecture: ``"unilateral"``, ``"bilateral"`` or ``"callosal"``; the aliases have one by default.
        units: units per hidden layer of the network, over both sides; None for 10 an arm.
        layers: hidden layers of the network.
        hidden_noise: standard deviation of the noise on each hidden unit's activity in the network, drawn anew whenever
            it acts or learns.
        n_arms: arms that the network commands, 1 or 2; None for 1, and to be given where the spaces are those of two
            arms. The hemispheric algorithms take it from the environment.
        ipsilateral_share: of two arms, weight of each hemisphere in the commands to the arm of its own side; None for
            0.15, 0 for no such path.
        trained_combination: of two arms, whether these weights are trained; None for False.
        critic_arch: units of each hidden layer of a critic.
        n_critics: number of critics of each stream.
        n_streams: number of reward streams.
        n_traces: traces of past actions that the critics see besides the observation, as many as the algorithm keeps.
        standardize_inputs: whether the critics standardize observations and traces.
        critic_activation_fn: what follows each hidden layer of a critic; the network's hidden units are tanh.
        log_std_init: log of the initial standard deviation, before the squashing; SAC only, as TD3 has none.
        **kwargs: further arguments of SB3's policy: those on features extractors, images and the optimizer.
            ``net_arch``, ``activation_fn`` and what concerns state-dependent exploration (gSDE) could not have their
            effect and are refused.

    Raises:
        ValueError: an unbounded or non-Box action space, sizes that the network cannot have, or an argument that could
            not have its effect.
    """

    NETWORK_KEY = "actor.network."
    architecture: ClassVar[Architecture] = "bilateral"
    stochastic: ClassVar[bool]
    actor: MotorActor
    critic: StreamCritics
    critic_target: StreamCritics

    def __init__(
        self,
        observation_space: spaces.Space[Any],
        action_space: spaces.Space[Any],
        lr_schedule: Schedule,
        architecture: Architecture | None = None,
        units: int | None = None,
        layers: int = 2,
        hidden_noise: float = 0.0,
        n_arms: int | None = None,
        ipsilateral_share: float | None = None,
        trained_combination: bool | None = None,
        critic_arch: tuple[int, ...] = (64, 64),
        n_critics: int = 2,
        n_streams: int = 1,
        n_traces: int = 0,
        standardize_inputs: bool = False,
        critic_activation_fn: type[nn.Module] = nn.ReLU,
        log_std_init: float = 0.0,
        **kwargs: Any,
    ) -> None:
        self._network = network_arguments(
            observation_space,
            action_space,
            n_arms,
            architecture=architecture or type(self).architecture,
            units=units,
            layers=layers,
            hidden_noise=hidden_noise,
            ipsilateral_share=ipsilateral_share,
            trained_combination=trained_combination,
        )
        self._log_std_init = finite("log_std_init", log_std_init)
        if not self.stochastic and self._log_std_init not in _STD_OF_SAVED:
            raise ValueError("log_std_init is not available for TD3, which explores by its action_noise.")
        self.critic_arch = widths("critic_arch", critic_arch)
        self.n_critics, self.n_streams = whole("n_critics", n_critics), whole("n_streams", n_streams)
        self.n_traces = whole("n_traces", n_traces, least=0)
        self.standardize_inputs = switch("standardize_inputs", standardize_inputs)
        if kwargs.get("activation_fn") is nn.ReLU:  # in policies that were saved before it was refused
            del kwargs["activation_fn"]
        super().__init__(
            observation_space,
            action_space,
            lr_schedule,
            net_arch={"pi": [], "qf": list(self.critic_arch)},
            activation_fn=critic_activation_fn,
            n_critics=self.n_critics * self.n_streams,
            **available(kwargs),
        )

    def make_actor(self, features_extractor: BaseFeaturesExtractor | None = None) -> MotorActor:
        """Build an actor with random weights; SB3 calls it for the actor and for its target."""
        arguments = {
            "observation_space": self.observation_space,
            "action_space": self.action_space,
            "normalize_images": self.normalize_images,
            "network": self._network,
            "log_std_init": self._log_std_init if self.stochastic else None,
        }
        return MotorActor(**self._update_features_extractor(arguments, features_extractor)).to(self.device)

    def make_critic(self, features_extractor: BaseFeaturesExtractor | None = None) -> StreamCritics:
        """Build all streams' critics with random weights; SB3 calls it for the critics and for their targets."""
        arguments = self._update_features_extractor(self.critic_kwargs, features_extractor)  # type: ignore[arg-type]
        arguments |= {"n_traces": self.n_traces, "standardize_inputs": self.standardize_inputs}
        return StreamCritics(**arguments).to(self.device)

    def _build(self, lr_schedule: Schedule) -> None:
        self._use_fused_adam()
        super()._build(lr_schedule)  # type: ignore[misc]

    @property
    def motor_network(self) -> MotorNetwork:
        """The actor's network: lesion it, or load weights trained elsewhere into it."""
        return self.actor.network

    def parameter_groups(self) -> dict[str, list[nn.Parameter]]:
        """Return every trained parameter by owner: the network's three groups, then ``critic_0``, ``critic_1``, ….

        The action's standard deviation, and features extractors' parameters if there are any, are shared.
        """
        groups = self.motor_network.parameter_groups()
        for stream in range(self.n_streams):
            critics = self.critic.q_networks[stream * self.n_critics : (stream + 1) * self.n_critics]
            groups[f"critic_{stream}"] = [parameter for critic in critics for parameter in critic.parameters()]
        owned = {id(parameter) for group in groups.values() for parameter in group}
        # By id: actor and critics may have one features extractor.
        trained = {id(parameter): parameter for parameter in (*self.actor.parameters(), *self.critic.parameters())}
        groups["shared"] += [parameter for key, parameter in trained.items() if key not in owned]
        return groups

    def stream_values(
        self, critics: StreamCritics, obs: Tensor, actions: Tensor, traces: Tensor | None = None
    ) -> Tensor:
        """Return the value that every critic of every stream gives to ``actions`` (b, n_actions) in [-1, 1].

        Args:
            critics: the policy's or their targets.
            obs: (b, n_observed).
            actions: (b, n_actions).
            traces: (b, traces_dim) of the actions before; None for critics that see none.

        Returns:
            (b, n_streams, n_critics).
        """
        values = torch.cat(critics(obs, actions, traces), dim=1)  # (b, n_streams · n_critics), stream by stream
        return values.reshape(len(values), self.n_streams, self.n_critics)

    def _get_constructor_parameters(self) -> dict[str, Any]:
        data = super()._get_constructor_parameters()
        critics = {"critic_arch": self.critic_arch, "n_critics": self.n_critics, "n_streams": self.n_streams}
        critics |= {"n_traces": self.n_traces, "standardize_inputs": self.standardize_inputs}
        critics |= {"critic_activation_fn": data["activation_fn"]}
        # SB3's SACPolicy forgets the second.
        others = {"log_std_init": self._log_std_init, "share_features_extractor": self.share_features_extractor}
        of_sb3 = {name: value for name, value in data.items() if name not in NOT_AVAILABLE}
        return of_sb3 | self._shape_of_network() | critics | others


class BilateralSACPolicy(BilateralOffPolicyPolicy, SACPolicy):  # type: ignore[misc] # an actor of our own
    """SAC's policy whose actor is one of the paper's networks."""

    stochastic = True


class BilateralTD3Policy(BilateralOffPolicyPolicy, TD3Policy):  # type: ignore[misc] # an actor of our own
    """TD3's policy whose actor is one of the paper's networks."""

    stochastic = False
    actor_target: MotorActor  # type: ignore[assignment]

    def _build(self, lr_schedule: Schedule) -> None:
        super()._build(lr_schedule)
        self.actor_target.network.noise = self.actor.network.noise  # one stream, or they would have the same noise


class UnilateralSACPolicy(BilateralSACPolicy):
    """:class:`BilateralSACPolicy` with the unilateral network."""

    architecture = "unilateral"


class CallosalSACPolicy(BilateralSACPolicy):
    """:class:`BilateralSACPolicy` with the bilateral network and its callosum."""

    architecture = "callosal"


class UnilateralTD3Policy(BilateralTD3Policy):
    """:class:`BilateralTD3Policy` with the unilateral network."""

    architecture = "unilateral"


class CallosalTD3Policy(BilateralTD3Policy):
    """:class:`BilateralTD3Policy` with the bilateral network and its callosum."""

    architecture = "callosal"


SAC_ALIASES: dict[str, type[BilateralSACPolicy]] = {
    "UnilateralPolicy": UnilateralSACPolicy,
    "BilateralPolicy": BilateralSACPolicy,
    "CallosalPolicy": CallosalSACPolicy,
}
"""The policies that SAC takes by name."""

TD3_ALIASES: dict[str, type[BilateralTD3Policy]] = {
    "UnilateralPolicy": UnilateralTD3Policy,
    "BilateralPolicy": BilateralTD3Policy,
    "CallosalPolicy": CallosalTD3Policy,
}
"""The policies that TD3 takes by name."""
