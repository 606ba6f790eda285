"""SydaTeleopEnv: teleoperation of a humanoid as a Gymnasium environment."""

from __future__ import annotations

from typing import Any, SupportsFloat

import gymnasium
import numpy as np
from gymnasium.spaces import Box
from numpy.typing import ArrayLike, NDArray

from syda_gym.embodiments.embodiment import FloatArray
from syda_gym.envs.face import Face
from syda_gym.envs.family import warn_if_cut
from syda_gym.envs.rendering import Painter
from syda_gym.envs.solo import Solo
from syda_gym.envs.spaces import action_from_command, action_space, wishes
from syda_gym.envs.task.options import TeleopOptions
from syda_gym.errors import OptionError, SydaError
from syda_gym.simulation.pictures.camera import CameraView, Picture
from syda_gym.simulation.pictures.window import has_display

__all__ = ["SydaTeleopEnv"]

Observation = NDArray[np.float32]
Action = NDArray[np.float32]


class SydaTeleopEnv(Face, gymnasium.Env[Observation, Action]):
    """Replays an operator's motion on a robot; an agent corrects what the mapping asks for.

    A person (the *operator*) moves; a mapping, or a chain of mappings along a *route* of bodies, turns every frame into
    joint angles for the robot, the *base command*; the agent adds a *correction* before the motors follow. Where a
    mapping asks for more than the joints' top speed, the base command goes there as fast as the motors can. The motion
    that the robot should have made is known frame by frame, because both were recorded together. One episode replays
    one clip.

        env = gymnasium.make("SydaTeleop-v0")
        observation, info = env.reset(seed=0)
        observation, reward, terminated, truncated, info = env.step(env.action_space.sample())

    ## Action space

    ``Box(-1, 1, (n,), float32)``: one correction per arm joint. The command is
    ``clamp(base + residual_scale * action)``, within the joint limits, those that depend on another joint included.
    Zero is the mapping alone. With ``action_mode="position"`` the action is the command itself, -1 at the lower and 1
    at the upper limit of the joint; ``env.unwrapped.action_from_command`` turns joint angles in rad into actions of
    either mode. Values outside the box are clipped; NaN and infinity raise ``OptionError``. For Pepper:

    | index | joint | range | unit | limits of the command [rad] | top speed [rad/s] |
    |---|---|---|---|---|---|
    | 0 | LShoulderPitch | -1 to 1 | 1 | -2.0857 to 2.0857 | 7.34 |
    | 1 | LShoulderRoll | -1 to 1 | 1 | 0.0087 to 1.5621 | 9.23 |
    | 2 | LElbowYaw | -1 to 1 | 1 | -2.0857 to 2.0857 | 7.34 |
    | 3 | LElbowRoll | -1 to 1 | 1 | -1.5621 to -0.0087 | 9.23 |
    | 4 | LWristYaw | -1 to 1 | 1 | -1.8239 to 1.8239 | 17.38 |
    | 5 | RShoulderPitch | -1 to 1 | 1 | -2.0857 to 2.0857 | 7.34 |
    | 6 | RShoulderRoll | -1 to 1 | 1 | -1.5621 to -0.0087 | 9.23 |
    | 7 | RElbowYaw | -1 to 1 | 1 | -2.0857 to 2.0857 | 7.34 |
    | 8 | RElbowRoll | -1 to 1 | 1 | 0.0087 to 1.5621 | 9.23 |
    | 9 | RWristYaw | -1 to 1 | 1 | -1.8239 to 1.8239 | 17.38 |

    ## Observation space

    A flat ``Box`` of float32; every number stays within its bounds. ``env.unwrapped.layout`` holds the blocks by name
    (``observation[layout["q"]]``), and ``layout.table()`` prints this table for the options at hand. With the defaults:

    | index | block | meaning | unit | low | high |
    |---|---|---|---|---|---|
    | 0 | `operator` | adult: LShoulder.x, newest packet | m | -10 | 10 |
    | 1 | `operator` | adult: LShoulder.y, newest packet | m | -10 | 10 |
    | 2 | `operator` | adult: LShoulder.z, newest packet | m | -10 | 10 |
    | 3 | `operator` | adult: LElbow.x, newest packet | m | -10 | 10 |
    | 4 | `operator` | adult: LElbow.y, newest packet | m | -10 | 10 |
    | 5 | `operator` | adult: LElbow.z, newest packet | m | -10 | 10 |
    | 6 | `operator` | adult: LHand.x, newest packet | m | -10 | 10 |
    | 7 | `operator` | adult: LHand.y, newest packet | m | -10 | 10 |
    | 8 | `operator` | adult: LHand.z, newest packet | m | -10 | 10 |
    | 9 | `operator` | adult: RShoulder.x, newest packet | m | -10 | 10 |
    | 10 | `operator` | adult: RShoulder.y, newest packet | m | -10 | 10 |
    | 11 | `operator` | adult: RShoulder.z, newest packet | m | -10 | 10 |
    | 12 | `operator` | adult: RElbow.x, newest packet | m | -10 | 10 |
    | 13 | `operator` | adult: RElbow.y, newest packet | m | -10 | 10 |
    | 14 | `operator` | adult: RElbow.z, newest packet | m | -10 | 10 |
    | 15 | `operator` | adult: RHand.x, newest packet | m | -10 | 10 |
    | 16 | `operator` | adult: RHand.y, newest packet | m | -10 | 10 |
    | 17 | `operator` | adult: RHand.z, newest packet | m | -10 | 10 |
    | 18 | `base_error` | LShoulderPitch: base command minus angle | rad | -4.271 | 4.271 |
    | 19 | `base_error` | LShoulderRoll: base command minus angle | rad | -1.653 | 1.653 |
    | 20 | `base_error` | LElbowYaw: base command minus angle | rad | -4.271 | 4.271 |
    | 21 | `base_error` | LElbowRoll: base command minus angle | rad | -1.653 | 1.653 |
    | 22 | `base_error` | LWristYaw: base command minus angle | rad | -3.748 | 3.748 |
    | 23 | `base_error` | RShoulderPitch: base command minus angle | rad | -4.271 | 4.271 |
    | 24 | `base_error` | RShoulderRoll: base command minus angle | rad | -1.653 | 1.653 |
    | 25 | `base_error` | RElbowYaw: base command minus angle | rad | -4.271 | 4.271 |
    | 26 | `base_error` | RElbowRoll: base command minus angle | rad | -1.653 | 1.653 |
    | 27 | `base_error` | RWristYaw: base command minus angle | rad | -3.748 | 3.748 |
    | 28 | `q` | LShoulderPitch: angle | rad | -2.186 | 2.186 |
    | 29 | `q` | LShoulderRoll: angle | rad | -0.09127 | 1.662 |
    | 30 | `q` | LElbowYaw: angle | rad | -2.186 | 2.186 |
    | 31 | `q` | LElbowRoll: angle | rad | -1.662 | 0.09127 |
    | 32 | `q` | LWristYaw: angle | rad | -1.924 | 1.924 |
    | 33 | `q` | RShoulderPitch: angle | rad | -2.186 | 2.186 |
    | 34 | `q` | RShoulderRoll: angle | rad | -1.662 | 0.09127 |
    | 35 | `q` | RElbowYaw: angle | rad | -2.186 | 2.186 |
    | 36 | `q` | RElbowRoll: angle | rad | -0.09127 | 1.662 |
    | 37 | `q` | RWristYaw: angle | rad | -1.924 | 1.924 |
    | 38 | `qd` | LShoulderPitch: speed | rad/s | -14.68 | 14.68 |
    | 39 | `qd` | LShoulderRoll: speed | rad/s | -18.46 | 18.46 |
    | 40 | `qd` | LElbowYaw: speed | rad/s | -14.68 | 14.68 |
    | 41 | `qd` | LElbowRoll: speed | rad/s | -18.46 | 18.46 |
    | 42 | `qd` | LWristYaw: speed | rad/s | -34.77 | 34.77 |
    | 43 | `qd` | RShoulderPitch: speed | rad/s | -14.68 | 14.68 |
    | 44 | `qd` | RShoulderRoll: speed | rad/s | -18.46 | 18.46 |
    | 45 | `qd` | RElbowYaw: speed | rad/s | -14.68 | 14.68 |
    | 46 | `qd` | RElbowRoll: speed | rad/s | -18.46 | 18.46 |
    | 47 | `qd` | RWristYaw: speed | rad/s | -34.77 | 34.77 |
    | 48 | `previous_action` | LShoulderPitch: previous action | 1 | -1 | 1 |
    | 49 | `previous_action` | LShoulderRoll: previous action | 1 | -1 | 1 |
    | 50 | `previous_action` | LElbowYaw: previous action | 1 | -1 | 1 |
    | 51 | `previous_action` | LElbowRoll: previous action | 1 | -1 | 1 |
    | 52 | `previous_action` | LWristYaw: previous action | 1 | -1 | 1 |
    | 53 | `previous_action` | RShoulderPitch: previous action | 1 | -1 | 1 |
    | 54 | `previous_action` | RShoulderRoll: previous action | 1 | -1 | 1 |
    | 55 | `previous_action` | RElbowYaw: previous action | 1 | -1 | 1 |
    | 56 | `previous_action` | RElbowRoll: previous action | 1 | -1 | 1 |
    | 57 | `previous_action` | RWristYaw: previous action | 1 | -1 | 1 |
    | 58 | `packet_age` | age of the newest packet | s | 0 | 10 |

    ``preview=k`` appends the base commands of the next ``k`` frames to ``base_error`` (a replay knows them; live, they
    cost ``k`` frames of latency). ``history=h`` appends ``base_history`` and ``q_history``, ``h`` frames each, newest
    first. The base command itself is ``base_error[:n] + q``.

    ## Reward

    The sum of these terms, all of them in ``info["reward_terms"]``; weights in ``reward={...}``
    (``syda_gym.envs.task.tracking.RewardWeights``):

    | term | formula | weight |
    |---|---|---|
    | ``joints`` | exp(-2 sum over joints of (q - reference)^2) | 0.5 |
    | ``landmarks`` | exp(-10 mean landmark error [m]) | 0.5 |
    | ``correction_change`` | - mean over joints of (correction - previous correction)^2 | 0.02 |
    | ``limits`` | - number of joints whose command was clipped | 0 |
    | ``contacts`` | - number of pairs of links that touch (with ``self_collision``) | 0 |
    | ``jitter`` | - mean third difference of the landmarks [m/frame^3] | 0 |

    The command of frame ``k`` is compared with the reference of frame ``k`` after one control step, so that a motor
    without lag would track perfectly.

    ## Start and end of an episode

    The robot stands still where the base command of the first frame puts it. The episode is *truncated* when the clip
    ends. It is *terminated* only if ``terminate_error`` is set and the mean landmark error exceeds it. ``is_success``
    in the last ``info`` says whether the mean landmark error of the whole episode stayed within ``success_error``.

    ## Info

    The same keys after ``reset`` and ``step``: ``reward_terms``; ``joint_error`` ``(n,)`` [rad] and ``landmark_error``
    ``(2 * arms,)`` [m] against the reference; ``jitter`` [m/frame^3]; ``limit_hits`` and ``contacts`` (counts); ``q``,
    ``command`` (executed), ``reference`` and ``base`` (of the *next* step) ``(n,)`` [rad]; ``landmarks`` and
    ``reference_landmarks`` ``(2 * arms, 3)`` [m] in the torso frame; ``packet_age`` [s]; ``frame``; ``motion`` (name of
    the clip) and ``motion_action`` (what is done in it); ``route`` (``adult>kid>pepper``) and its ``transferability``;
    ``is_success``.

    ## Options

    | option | default | meaning |
    |---|---|---|
    | ``operator`` | ``"adult"`` | who leads: a body of the motions |
    | ``robot`` | ``"pepper"`` | who follows: ``pepper``, ``nao`` or any registered robot |
    | ``route`` | ``"auto"`` | ``auto`` (best), ``sample`` (drawn by T), ``per_motion`` (best for each clip), or names |
    | ``predictor`` | ``"dry_run"`` | ranks routes: ``dry_run``, ``measured`` (once fitted), ``T``, ``hops`` ... |
    | ``mapping`` | ``"syda"`` | a method of ``syda_gym.mappings.METHODS``, a ``Mapping``, or a folder of fitted ones |
    | ``preset`` | ``None`` | preset of the method; its default if ``None`` |
    | ``motions`` | ``"embedded"`` | synthetic default, ``"paper:DIR"``, any spec of ``load_motions``, or ``Motions`` |
    | ``fps`` | ``None`` | frame rate of recordings that do not say |
    | ``clips`` | ``None`` | indices or names of the clips to play |
    | ``actions`` | ``None`` | play only clips of these actions |
    | ``held_out`` | ``()`` | actions that no mapping may be fitted on |
    | ``via`` | ``None`` | bodies that routes may pass; the paper's adult, kid, pepper by default |
    | ``fit_seed`` | ``0`` | seed of fits |
    | ``reference`` | ``"auto"`` | ``paired`` (the robot's own motion) where there is one, else ``mapped`` |
    | ``action_mode`` | ``"residual"`` | or ``position`` |
    | ``residual_scale`` | ``0.25`` | correction at action 1 [rad] |
    | ``preview``, ``history`` | ``0``, ``0`` | future and past frames in the observation |
    | ``control_hz``, ``physics_hz`` | ``30``, ``240`` | physics must be a whole multiple of control |
    | ``physics`` | ``"bullet"`` | or ``servo``: the motor law in numpy, hundreds of times faster, without contacts |
    | ``self_collision`` | ``False`` | links of the robot collide with each other |
    | ``whole_body`` | ``False`` | simulate head, hip, knee and wheels as joints, too, for three times the cost |
    | ``reward`` | ``None`` | weights that differ from the table above |
    | ``terminate_error`` | ``None`` | mean landmark error that ends an episode [m] |
    | ``success_error`` | ``None`` | mean landmark error of a successful episode [m]; 0.036 paired, 0.008 mapped |
    | ``start`` | ``"first"`` | first frame: ``first``, ``uniform``, or ``failures`` (where the error is large) |
    | ``disturbances`` | ``None`` | ``"teleop:CELL:LEVEL"``, another preset, a dict, or ``Disturbances`` |
    | ``camera`` | ``None`` | ``CameraView`` or a dict: size, place, ghost, operator, error colours, meshes |
    | ``render_mode`` | ``None`` | ``rgb_array``, ``rgb_array_list``, or ``human`` where there is a display |

    ``reset(options=...)`` takes ``motion`` (name or index of a clip), ``frame`` and ``route``.

    A robot of which the motions hold nothing is driven by what you recorded of it (``syda-gym record``), else by the
    unfitted mapping; a warning says which.

    Disturbances are off by default; ``syda_gym.envs.task.disturbances`` lists the cells (``lag``, ``noise``,
    ``latency``, ``noise+latency``, ``full``), the levels (``train``, ``test``, ``harsh``) and the single presets.
    ``"dynamics"`` draws motors, payload and friction anew for every episode and changes them within it.

    ## Determinism

    Same options, seed and actions give the same bits: in another process, after any number of resets, after pickling in
    the middle of an episode, alone or as one of many in ``SydaTeleopVectorEnv``, with self-collision as well.

    ## Version history

    * v0: first version.

    Raises:
        UnknownOptionError: an unknown option (a ``TypeError``, too); the message says which is nearest.
        OptionError: a value outside what is allowed; the message lists what is.
        RouteError: no such route.
        MotionError: motions that cannot be read, or in which operator and robot do not occur together.
        MappingError: a mapping between other bodies.
    """

    _fleet: Solo
    metadata = {"render_modes": ["human", "rgb_array", "rgb_array_list"], "render_fps": 30}  # noqa: RUF012

    def __init__(
        self,
        render_mode: str | None = None,
        *,
        options: TeleopOptions | None = None,
        **changes: Any,
    ) -> None:
        if render_mode is not None and render_mode not in self.metadata["render_modes"]:
            raise OptionError(
                f"render_mode={render_mode!r} is not allowed; choose one of {self.metadata['render_modes']}"
            )
        self.options = TeleopOptions.of(options, changes)
        self.render_mode = render_mode
        self._fleet = Solo(self.options)
        self.metadata = {
            # Without a display, 'human' is not offered, so that tools which try every mode leave it alone.
            "render_modes": [mode for mode in type(self).metadata["render_modes"] if mode != "human" or has_display()],
            "render_fps": round(self._fleet.rates.control_hz),
        }
        self.observation_space = Box(self.layout.low, self.layout.high, dtype=np.float32)
        self.action_space = action_space(self.robot)
        self._started = False
        self._painter = Painter(CameraView.resolve(self.options.camera))
        self._pictures: list[Picture] = []

    def action_from_command(self, command: ArrayLike) -> FloatArray:
        """The action whose command comes nearest to ``command``, in either action mode.

        Args:
            command: joint angles ``(n,)`` [rad].

        Returns:
            ``(n,)``, within the action space.
        """
        return action_from_command(
            self.options, self.robot, np.asarray(command, dtype=np.float64), self._fleet.present_base
        )

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Observation, dict[str, Any]]:
        """Begins an episode.

        Args:
            seed: new seed of the environment's random numbers; ``None`` goes on with them.
            options: ``motion`` (name or index of a clip), ``frame`` (first frame), ``route`` (names of bodies).

        Raises:
            OptionError: unknown options or values.
            RouteError: the route cannot be taken.
            SydaError: the environment is closed.
        """
        self._check_open("reset")
        if not self._started and self.spec is not None:  # made by its id, so there is a limit
            warn_if_cut(self._fleet.repertoire.longest)
        super().reset(seed=seed)
        wish = wishes(self._fleet.repertoire, options, 1)
        observation, info = self._fleet.begin(self.np_random, wish[0])
        self._started = True
        if self.render_mode in ("human", "rgb_array_list"):
            self._pictures.clear()
            self._draw()
        return observation, info

    def step(self, action: Action) -> tuple[Observation, SupportsFloat, bool, bool, dict[str, Any]]:
        """One control step.

        Args:
            action: ``(n,)`` in [-1, 1].

        Raises:
            OptionError: wrong shape or values that are not finite.
            SydaError: not reset yet, or closed.
        """
        self._check_open("step")
        if not self._started:
            raise SydaError("step was called before reset; call reset first")
        result = self._fleet.play(action)
        if self.render_mode in ("human", "rgb_array_list"):
            self._draw()
        return result

    def render(self) -> Any:
        """What the render mode asks for.

        Returns:
            ``rgb_array``: a picture ``(height, width, 3)`` uint8. ``rgb_array_list``: the pictures since the last call
            or reset. ``human``: nothing; the window is kept up to date by ``reset`` and ``step``.

        Raises:
            SydaError: not reset yet, or closed.
        """
        if self.render_mode is None:
            gymnasium.logger.warn(
                "render() does nothing without a render mode; make the environment with render_mode='rgb_array'"
            )
            return None
        self._check_open("render")
        if not self._started:
            raise SydaError("render was called before reset; call reset first")
        if self.render_mode == "rgb_array_list":
            pictures, self._pictures = self._pictures, []
            return pictures
        return self._painter.picture(self._fleet) if self.render_mode == "rgb_array" else None

    def close(self) -> None:
        """Releases physics, camera and window; harmless when repeated."""
        self._released = True
        self._fleet.close()
        self._painter.close()

    def _draw(self) -> None:
        if self.render_mode == "human":
            self._painter.show(self._fleet)
        else:
            self._pictures.append(self._painter.picture(self._fleet))
