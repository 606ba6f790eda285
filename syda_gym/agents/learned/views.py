"""Views: how a residual policy looks at a robot: as a whole, or at each arm as if it were the left one."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from syda_gym.agents.interface import Interface, Reading
from syda_gym.embodiments.embodiment import FloatArray
from syda_gym.embodiments.robot import Robot
from syda_gym.errors import AgentError, EmbodimentError

__all__ = ["Views", "mirror_of"]

_LEFT_OUT = ("previous_action",)  # the low-passed correction itself takes its place
_OPERATOR = "operator"
_PLAIN = "packet_age"  # the one block that looks the same in a mirror


class Views:
    """Features of a policy and the joints that it answers for.

    **The whole robot** (``each_arm=False``): the observation without the previous action, the command from below minus
    the joint angles, the correction so far. One view a robot, an answer for every joint.

    **Each arm** (``each_arm=True``): two views a robot, the second in a mirror, so that the arm that is answered for is
    always a left one. One network serves both arms, learns from both, and is paid for each by what that arm does:
    elbow, wrist and joints of one arm do not depend on the command of the other. The operator's own frame is left out:
    it would tie a policy to one operator and its axes, and what it says stands in the base command.

    Args:
        interface: robot and observation layout.
        each_arm: see above.

    Attributes:
        count: views of a robot, 1 or 2.
        size: features ``F`` of a view.
        outputs: joints that a view answers for.
        blocks: slices of the observation that are seen, in this order.
        order: where each feature of the mirrored view comes from ``(F,)``.
        signs: of each feature of the mirrored view ``(F,)``.
        answer_signs: of the answers for the arm in the mirror ``(outputs,)``.

    Raises:
        AgentError: ``each_arm`` for a robot whose arms are no mirror images.
    """

    def __init__(self, interface: Interface, each_arm: bool) -> None:
        n = interface.n
        self.n, self.each_arm, self.count = n, each_arm, 2 if each_arm else 1
        left_out = (*_LEFT_OUT, _OPERATOR) if each_arm else _LEFT_OUT
        kept = {name: part for name, part in interface.layout.items() if name not in left_out}
        self.blocks = tuple(kept.values())
        self.size = sum(part.stop - part.start for part in self.blocks) + 2 * n
        self.outputs = n // self.count
        self.order: NDArray[np.intp] = np.arange(self.size)
        self.signs: FloatArray = np.ones(self.size)
        self.answer_signs: FloatArray = np.ones(self.outputs)
        if each_arm:
            mirror = mirror_of(interface.robot)
            if mirror is None:
                raise AgentError(
                    f"the arms of robot {interface.robot.name!r} are no mirror images of each other; use each_arm=False"
                )
            self._set_mirror(kept, *mirror)

    def _set_mirror(self, kept: dict[str, slice], order: NDArray[np.intp], signs: FloatArray) -> None:
        sources, turned, at = [], [], 0
        widths = [(name == _PLAIN, part.stop - part.start) for name, part in kept.items()]
        for plain, width in [*widths, (False, self.n), (False, self.n)]:
            for start in range(at, at + width, 1 if plain else self.n):
                sources.append([start] if plain else start + order)
                turned.append([1.0] if plain else signs)
            at += width
        self.order, self.signs = np.concatenate(sources).astype(np.intp), np.concatenate(turned)
        self.answer_signs = signs[self.outputs :]

    def see(self, command: FloatArray, correction: FloatArray, reading: Reading) -> FloatArray:
        """What a policy sees, before normalisation.

        Args:
            command: of the agent below ``(B, n)`` [rad].
            correction: the low-passed correction so far ``(B, n)``, in [-1, 1].
            reading: the decoded observation.

        Returns:
            ``(count B, F)``: the robots one after the other, then, if there are two views, once more in the mirror.
        """
        seen = [reading.observation[:, part] for part in self.blocks]
        features = np.concatenate([*seen, command - reading.q, correction], axis=1)
        if self.count == 1:
            return features
        return np.concatenate([features, features[:, self.order] * self.signs])

    def join(self, answers: NDArray[Any]) -> FloatArray:
        """Answers ``(count B, outputs)`` as one row a robot ``(B, n)``."""
        if self.count == 1:
            return np.asarray(answers, dtype=np.float64)
        left, right = np.split(np.asarray(answers, dtype=np.float64), 2)
        return np.concatenate([left, right * self.answer_signs], axis=1)


def mirror_of(robot: Robot) -> tuple[NDArray[np.intp], FloatArray] | None:
    """Which joint takes the place of which in a mirror, and with which sign, ``(n,)`` each; ``None`` without a mirror.

    ``robot.mirror(q)`` is ``q[:, order] * signs``.
    """
    numbers = np.arange(1.0, len(robot.joint_names) + 1.0)
    try:
        mirrored = robot.mirror(numbers[None])[0]
    except EmbodimentError:
        return None
    return (np.abs(mirrored) - 1.0).round().astype(np.intp), np.sign(mirrored)
