"""TrainingSettings: sizes, losses and optimiser of dual autoencoders."""

from __future__ import annotations

from dataclasses import dataclass

from syda_gym.errors import OptionError

__all__ = ["TrainingSettings"]


@dataclass(frozen=True)
class TrainingSettings:
    """Sizes, losses and optimiser, equal for all jobs of a batch.

    Attributes:
        hidden_a: widths between A's code and the latent features; the decoder mirrors them.
        hidden_b: the same for B.
        latent: number of latent features (synergies).
        slope: of the leaky ReLU; 1 for linear networks.
        activated: whether the latent features are activated too, as Eq. 1 has it for every layer.
        dual: the dual autoencoder; otherwise only A's encoder and B's decoder are built.
        reconstruct: weight of A-to-A and B-to-B, Eq. 2 and 3.
        align: weight of the latent loss, Eq. 4.
        cross: weight of A-to-B and B-to-A.
        huber: width of the Huber loss's quadratic part.
        rate: learning rate of Adam.
        decay: decoupled weight decay (AdamW).
        cosine: let the rate fall to zero along a half cosine.
        batch: rows a step.
        epochs: passes over the rows.
        noise: standard deviation of the noise added to the inputs (codes are standardised then).
    """

    hidden_a: tuple[int, ...] = (16, 14, 12)
    hidden_b: tuple[int, ...] = (32, 24, 16)
    latent: int = 10
    slope: float = 0.01
    activated: bool = True
    dual: bool = True
    reconstruct: float = 1.0
    align: float = 1.0
    cross: float = 0.0
    huber: float = 0.6
    rate: float = 1e-3
    decay: float = 0.0
    cosine: bool = False
    batch: int = 20
    epochs: int = 200
    noise: float = 0.0

    def __post_init__(self) -> None:
        widths = (*self.hidden_a, *self.hidden_b, self.latent, self.batch, self.epochs)
        if min(widths) < 1 or not (self.rate > 0 and self.huber > 0 and self.noise >= 0 and self.decay >= 0):
            raise OptionError(f"sizes, batch, epochs, rate and huber must be positive, noise and decay >= 0: {self}")

    def stacks(self, width_a: int, width_b: int) -> dict[str, tuple[int, ...]]:
        """Layer widths of each stack, input and output included."""
        encode_a = (width_a, *self.hidden_a, self.latent)
        encode_b = (width_b, *self.hidden_b, self.latent)
        if not self.dual:
            return {"encode_a": encode_a, "decode_b": encode_b[::-1]}
        return {"encode_a": encode_a, "decode_a": encode_a[::-1], "encode_b": encode_b, "decode_b": encode_b[::-1]}
