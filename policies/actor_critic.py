"""The networks as stable-baselines3 actor-critic policies, for PPO and A2C."""

from __future__ import annotations

from typing import Any, ClassVar

import torch
from gymnasium import spaces
from stable_baselines3.common.distributions import Distribution, SquashedDiagGaussianDistribution
from stable_baselines3.common.policies import ActorCriticPolicy, BasePolicy
from stable_baselines3.common.preprocessing import get_action_dim
from stable_baselines3.common.type_aliases import PyTorchObs, Schedule
from torch import Tensor, nn

from bilateral_rl.policies.motor_network import MotorNetwork
from bilateral_rl.policies.motor_policy import Constrained, MotorPolicy, check_traces, network_arguments
from bilateral_rl.policies.networks import make_network
from bilateral_rl.policies.quantities import finite, whole, widths
from bilateral_rl.policies.sb3_arguments import NOT_AVAILABLE, available
from bilateral_rl.vocabulary import Architecture


class BilateralActorCriticPolicy(MotorPolicy, Constrained, ActorCriticPolicy):
    """Actor-critic policy whose actor is one of the paper's networks.

    An action is ``tanh`` of a Gaussian around half the network's output before its sigmoid, rescaled to the action
    space. As sigmoid(z) = (tanh(z / 2) + 1) / 2, the deterministic action on muscles commanded in [-1, 1] is exactly
    the network's sigmoid output. The critics are networks of their own and see the same observation, and traces of past
    actions if there are any. Those the algorithm keeps: SB3's ``forward``, ``evaluate_actions`` and ``predict_values``,
    which have no argument for them, are then refused. So are ``forward`` and ``evaluate_actions`` of a network with
    noise: the noise of an action is part of what its density depends on, and must be the same when that is computed
    again, as the hemispheric algorithms do.

    Args:
        observation_space: any space that SB3 flattens.
        action_space: a bounded Box.
        lr_schedule: learning rate by remaining progress.
        architecture: ``"unilateral"``, ``"bilateral"`` or ``"callosal"``; the aliases below have one by default.
        units: units per hidden layer of the actor, over both sides; None for 10 an arm.
        layers: hidden layers of the actor.
        hidden_noise: standard deviation of the noise on each hidden unit's activity in the actor, whatever it is for.
        n_arms: arms that the network commands, 1 or 2; None for 1, and to be given where the spaces are those of two
            arms. The hemispheric algorithms take it from the environment.
        ipsilateral_share: of two arms, weight of each hemisphere in the commands to the arm of its own side; None for
            0.15, 0 for no such path.
        trained_combination: of two arms, whether these weights are trained; None for False.
        critic_arch: units of each hidden layer of a critic.
        n_streams: number of reward streams, a critic for each. SB3's scalar value is the mean of the streams' values.
        n_traces: traces of past actions that the critics see besides the observation, as many as the algorithm keeps.
        critic_activation_fn: what follows each hidden layer of a critic; the network's hidden units are tanh.
        log_std_init: log of the initial standard deviation, before the squashing.
        **kwargs: further arguments of SB3's ``ActorCriticPolicy``: those on features extractors, images and the
            optimizer. ``net_arch``, ``activation_fn``, ``ortho_init``, ``squash_output`` and what concerns
            state-dependent exploration (gSDE) could not have their effect and are refused.

    Raises:
        ValueError: an unbounded or non-Box action space, sizes that the network cannot have, or an argument that could
            not have its effect.
    """

    architecture: ClassVar[Architecture] = "bilateral"
    NETWORK_KEY = "mlp_extractor.actor."

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
        n_streams: int = 1,
        n_traces: int = 0,
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
        self.critic_arch = widths("critic_arch", critic_arch)
        self.critic_activation_fn = critic_activation_fn
        self.n_streams, self.n_traces = whole("n_streams", n_streams), whole("n_traces", n_traces, least=0)
        super().__init__(
            observation_space,
            action_space,
            lr_schedule,
            net_arch=[],
            ortho_init=False,
            log_std_init=finite("log_std_init", log_std_init),
            **available(kwargs),
        )

    def _build(self, lr_schedule: Schedule) -> None:
        assert isinstance(self.action_space, spaces.Box)
        n_actions = get_action_dim(self.action_space)
        self._squash_output = True
        self.action_dist = SquashedDiagGaussianDistribution(n_actions)
        traces_dim = self.n_traces * (n_actions + 1)
        actor = make_network(n_inputs=self.features_dim, n_outputs=n_actions, **self._network)
        critics = [
            _critic(self.features_dim + traces_dim, self.critic_arch, self.critic_activation_fn)
            for _ in range(self.n_streams)
        ]
        self.mlp_extractor = _Latents(actor, critics, traces_dim)  # type: ignore[assignment]
        self.action_net = nn.Identity()  # type: ignore[assignment]
        self.value_net = _MeanOfStreams()  # type: ignore[assignment]
        self.log_std = nn.Parameter(torch.full((n_actions,), float(self.log_std_init)))
        self._use_fused_adam()
        self.optimizer = self.optimizer_class(self.parameters(), lr=lr_schedule(1), **self.optimizer_kwargs)  # type: ignore[call-arg]

    @property
    def motor_network(self) -> MotorNetwork:
        """The actor's network: lesion it, or load weights trained elsewhere into it."""
        return self.mlp_extractor.actor  # type: ignore[return-value]

    def parameter_groups(self) -> dict[str, list[nn.Parameter]]:
        """Return every parameter by owner: the network's three groups, then ``critic_0``, ``critic_1``, ….

        The action's standard deviation, and a features extractor's parameters if there are any, are shared.
        """
        groups = self.motor_network.parameter_groups()
        critics = self.mlp_extractor.critics
        groups |= {f"critic_{i}": list(critic.parameters()) for i, critic in enumerate(critics)}  # type: ignore[arg-type,union-attr]
        owned = {id(parameter) for group in groups.values() for parameter in group}
        groups["shared"] += [parameter for parameter in self.parameters() if id(parameter) not in owned]
        return groups

    def action_mean(self, obs: PyTorchObs, noise: Tensor | None = None) -> Tensor:
        """Return the mean of the Gaussian before the squashing, (n, n_actions).

        Args:
            obs: (n, n_observed).
            noise: (n, layers · sides, width), what ``motor_network.noise`` drew for these; None for no noise.
        """
        features = BasePolicy.extract_features(self, obs, self.pi_features_extractor)
        return self.mlp_extractor.forward_actor(features, noise)  # type: ignore[no-any-return, operator, arg-type, call-arg]

    def get_distribution(self, obs: PyTorchObs) -> Distribution:
        """Return the distribution of actions, with noise that is drawn for it."""
        noise = self.motor_network.noise.draw(len(obs), self.device)
        return self._get_action_dist_from_latent(self.action_mean(obs, noise))

    def forward(self, obs: Tensor, deterministic: bool = False) -> tuple[Tensor, Tensor, Tensor]:
        """Return actions (n, *action shape), values (n, 1) and log probabilities (n,), as SB3's own algorithms ask.

        Raises:
            ValueError: a network with noise, or critics that see traces.
        """
        self._check_forgetful()
        return super().forward(obs, deterministic)

    def evaluate_actions(self, obs: PyTorchObs, actions: Tensor) -> tuple[Tensor, Tensor, Tensor | None]:
        """Return values (n, 1) and log probabilities (n,) of actions, and the entropy, as SB3's own algorithms ask.

        Raises:
            ValueError: a network with noise, or critics that see traces.
        """
        self._check_forgetful()
        return super().evaluate_actions(obs, actions)

    def _check_forgetful(self) -> None:
        """Refuse noise that nobody keeps until the density of an action is computed again."""
        if self.motor_network.noise.std:
            raise ValueError(
                "SB3's PPO and A2C forget the noise that an action was taken with (hidden_noise): train by "
                "HemisphericPPO or HemisphericA2C, which take loss='combined' too, or leave hidden_noise out."
            )

    def predict_stream_values(self, obs: PyTorchObs, traces: Tensor | None = None) -> Tensor:
        """Return the value of each reward stream, (n, n_streams).

        Args:
            obs: (n, n_observed).
            traces: (n, traces_dim), of the actions before; None for critics that see none.

        Raises:
            ValueError: traces that are missing or of another size.
        """
        features = BasePolicy.extract_features(self, obs, self.vf_features_extractor)
        return self.mlp_extractor.forward_critic(features, traces)  # type: ignore[no-any-return, operator, arg-type, call-arg]

    def _get_constructor_parameters(self) -> dict[str, Any]:
        data = super()._get_constructor_parameters()
        critics = {
            "critic_arch": self.critic_arch,
            "n_streams": self.n_streams,
            "n_traces": self.n_traces,
            "critic_activation_fn": self.critic_activation_fn,
            "share_features_extractor": self.share_features_extractor,  # which SB3 forgets
        }
        others = {name: value for name, value in data.items() if name not in NOT_AVAILABLE}
        return others | self._shape_of_network() | critics


class UnilateralPolicy(BilateralActorCriticPolicy):
    """:class:`BilateralActorCriticPolicy` with the unilateral network."""

    architecture = "unilateral"


class BilateralPolicy(BilateralActorCriticPolicy):
    """:class:`BilateralActorCriticPolicy` with the bilateral network."""

    architecture = "bilateral"


class CallosalPolicy(BilateralActorCriticPolicy):
    """:class:`BilateralActorCriticPolicy` with the bilateral network and its callosum."""

    architecture = "callosal"


class _Latents(nn.Module):
    """SB3's ``mlp_extractor``: maps features to half the actor's output, and to the streams' values."""

    def __init__(self, actor: MotorNetwork, critics: list[nn.Sequential], traces_dim: int) -> None:
        super().__init__()
        self.actor = actor
        self.traces_dim = traces_dim
        self.critics = nn.ModuleList(critics)
        self.latent_dim_pi, self.latent_dim_vf = actor.n_outputs, len(critics)

    def forward(self, features: Tensor) -> tuple[Tensor, Tensor]:
        """Map features (n, n_inputs) to half the actor's output (n, n_actions) and the values (n, n_streams)."""
        return self.forward_actor(features), self.forward_critic(features)

    def forward_actor(self, features: Tensor, noise: Tensor | None = None) -> Tensor:
        """Map features (n, n_inputs) to half the network's output (n, n_actions), with the noise of its units."""
        # The network gives z, and SB3 squashes what it gets by tanh; from z / 2 comes tanh(z / 2) = 2 sigmoid(z) - 1:
        # the excitation sigmoid(z) in [0, 1], as a command in [-1, 1].
        return self.actor(features, noise) / 2  # type: ignore[no-any-return]

    def forward_critic(self, features: Tensor, traces: Tensor | None = None) -> Tensor:
        """Map features (n, n_inputs) and traces (n, traces_dim) to the value of each stream (n, n_streams).

        Raises:
            ValueError: traces that are missing or of another size.
        """
        check_traces(self.traces_dim, traces)
        if traces is not None and self.traces_dim:
            features = torch.cat([features, traces], dim=1)
        return torch.cat([critic(features) for critic in self.critics], dim=1)


class _MeanOfStreams(nn.Module):
    """SB3's ``value_net``: maps the streams' values to one, for those who ask an SB3 policy for its value."""

    def forward(self, values: Tensor) -> Tensor:
        """Map values (n, n_streams) to their mean (n, 1)."""
        return values.mean(dim=1, keepdim=True)


def _critic(n_inputs: int, units: tuple[int, ...], activation_fn: type[nn.Module]) -> nn.Sequential:
    """Build a value network, (n, n_inputs) to (n, 1), whose hidden layers begin with orthogonal kernels."""
    layers: list[nn.Module] = []
    for width in units:
        layers += [nn.Linear(n_inputs, width), activation_fn()]
        nn.init.orthogonal_(layers[-2].weight, gain=2**0.5)  # type: ignore[arg-type]
        nn.init.zeros_(layers[-2].bias)  # type: ignore[arg-type]
        n_inputs = width
    layers.append(nn.Linear(n_inputs, 1))
    return nn.Sequential(*layers)
